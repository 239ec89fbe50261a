"""Weights & Biases; its own settings say where to, such as ``WANDB_MODE=offline``."""

from __future__ import annotations

from collections.abc import Mapping

import wandb

from innerattn.loggers.logger import Ending, Opened

PROJECT = "innerattn"
"""Unless ``WANDB_PROJECT`` names another one."""


def open_wandb(run: Opened) -> WandbLogger:
    """A logger with a W&B run of its own, so that several runs in one process do not mix."""
    settings = wandb.Settings(console="off", silent=True, disable_git=True, disable_code=True)
    if settings.project is None:
        settings.project = PROJECT
    begun = wandb.init(name=run.name, config=run.parameters, settings=settings, reinit="create_new")
    begun.define_metric("*", step_metric="env_steps")
    return WandbLogger(begun)


class WandbLogger:
    """Sends numbers with ``env_steps`` among them, which is the axis of all plots."""

    def __init__(self, run: wandb.Run) -> None:
        self._run = run

    def log(self, env_steps: int, values: Mapping[str, float]) -> None:
        """Send the numbers."""
        self._run.log({**values, "env_steps": env_steps})

    def close(self, ending: Ending, /) -> None:
        """Send what is left."""
        self._run.finish(exit_code=0 if ending == "done" else 1)
