"""Runs that benches measure: trained where they are missing, one core each, side by side.

Without a warm start and options they are those of a study (`experiments.plan`), also by name.
"""

from __future__ import annotations

import shutil
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from innerattn.config import RunConfig, load_run_config, read_toml
from innerattn.cores import usable_cores
from innerattn.experiments.plan import of_seed
from innerattn.experiments.scan import differences
from innerattn.experiments.side_by_side import Run as Training
from innerattn.experiments.side_by_side import train_side_by_side


@dataclass(frozen=True)
class Run:
    """One run, by what it was trained with; ``options`` are other values by dotted key."""

    preset: str
    method: str
    budget: str
    seed: int
    warm_start: str = "none"
    options: tuple[tuple[str, object], ...] = ()

    @property
    def config(self) -> RunConfig:
        """What it is trained with; each seed is measured in worlds of its own."""
        other = {"train.warm_start": self.warm_start, **dict(self.options), **of_seed(self.seed)}
        return load_run_config(self.preset, self.method, self.budget, overrides=other)

    @property
    def name(self) -> str:
        """The name of its folder."""
        parts = [self.preset, self.method]
        parts += [] if self.warm_start == "none" else [f"from-{self.warm_start}"]
        parts += [f"{key}-{value}".replace(".", "-").lower() for key, value in self.options]
        return "-".join([*parts, self.budget, f"s{self.seed}"])


def train_all(wanted: Sequence[Run], runs: Path, workers: int | None = None) -> list[Path]:
    """The folders of all runs wanted, in their order; those missing or cut short are trained.

    Raises:
        SystemExit: training failed, or a folder holds another run.
    """
    folders = [runs / run.name for run in wanted]
    missing = []
    for run, folder in zip(wanted, folders, strict=True):
        if not (folder / "evaluation" / "summary.json").exists():
            missing.append(Training(run.config, folder))
        elif other := differences(read_toml(folder / "config.toml"), run.config):
            sys.exit(f"{folder}: holds another run: {'; '.join(other)}")
    for training in missing:
        shutil.rmtree(training.folder, ignore_errors=True)
    train_side_by_side(missing, workers or usable_cores(), changed=lambda _: None, failed=_give_up)
    return folders


def _give_up(run: Training) -> None:
    sys.exit(f"{run.folder}: {run.failure}")
