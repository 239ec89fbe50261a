"""Trains and measures several runs side by side, each in a process of its own."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from innerattn.config import RunConfig
from innerattn.experiments.processes import Job

if TYPE_CHECKING:
    from innerattn.evaluate import Summary
    from innerattn.train import Progress

_TRAINING = 0.95
"""Part of a run that is training; the rest is evaluation."""


@dataclass
class Run(Job):
    """One run: the same as `innerattn train` for one seed. Its result is a `Summary`.

    Attributes:
        config: what is trained.
        folder: where.
        trained: it is trained already, and only measured.
        log: where its metrics go beside the run folder, names of `innerattn.loggers.LOGGERS`.
        begun: it was stopped in training, which goes on from its newest checkpoint, or begins anew
            if there is none that can be read.
    """

    config: RunConfig
    folder: Path
    trained: bool = False
    log: tuple[str, ...] = ()
    begun: bool = False

    @property
    def size(self) -> float:
        """How much there is to do, in whole runs."""
        return 1.0 - _TRAINING if self.trained else 1.0

    @property
    def summary(self) -> Summary | None:
        """What its evaluation found, once it is done."""
        found: Summary | None = self.result
        return found

    def do(self, report: Callable[[float], None]) -> Summary:
        """Train it, unless it is trained, and evaluate it."""
        from innerattn.evaluate import evaluate_run
        from innerattn.loggers import Opened, RunLoggers

        report(0.0)
        before = 0.0 if self.trained else _TRAINING
        run = Opened(self.folder, self.config)
        with RunLoggers(self.log, run, failed=say_not_logged) as loggers:

            def progress(newest: Progress) -> None:
                report(before * trained_share(self.config, newest))
                loggers(newest)

            if not self.trained:
                self._train(progress)
            evaluation = evaluate_run(
                self.folder,
                progress=lambda done, total: report(before + done / total * (1.0 - before)),
            )
            evaluation.write(self.folder / "evaluation")
            loggers.log_scores(evaluation.summary)
        return evaluation.summary

    def _train(self, progress: Callable[[Progress], None]) -> None:
        from innerattn.train import DamagedCheckpointError, NothingToResumeError, resume, train

        if self.begun:
            try:
                resume(self.folder, progress=progress)
                return
            except (NothingToResumeError, DamagedCheckpointError):
                shutil.rmtree(self.folder)
        train(self.config, self.folder, progress=progress)


def refuse_what_cannot_run(runs: Sequence[Run]) -> None:
    """Find out in time what every run would fail of.

    Raises:
        RunError: the folder of a run that is to be trained exists.
        ConfigError: the configuration cannot be run here.
    """
    from innerattn.envs import BatchEnv
    from innerattn.train.build import build_learner
    from innerattn.train.checkpoint import refuse_existing

    for run in runs:
        if not run.trained and not run.begun:
            refuse_existing(run.folder)
    config = runs[0].config
    with closing(BatchEnv(config.scenario, 1, num_threads=1)) as env:
        build_learner(config, env)


def say_not_logged(problem: str) -> None:
    """Say on standard error that a logger failed."""
    print(f"innerattn: warning: --log {problem}; training goes on without it", file=sys.stderr)


def trained_share(config: RunConfig, progress: Progress) -> float:
    """Part of the env-steps of a run that is done, imitation and learning from rewards together."""
    before = config.imitation.env_steps if config.train.warm_start != "none" else 0
    done = progress.env_steps + (before if progress.stage == "training" else 0)
    return done / (before + config.train.env_steps)
