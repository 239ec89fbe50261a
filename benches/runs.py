"""Runs that benches measure: trained where they are missing, one core each, side by side."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Run:
    """One run, by what it was trained with."""

    preset: str
    method: str
    budget: str
    seed: int
    warm_start: str = "none"
    options: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """The name of its folder."""
        parts = [self.preset, self.method]
        parts += [] if self.warm_start == "none" else [f"from-{self.warm_start}"]
        parts += [option.lstrip("-").replace(".", "-") for option in self.options]
        return "-".join([*parts, self.budget, f"s{self.seed}"])

    def train(self, runs: Path) -> Path:
        """Its folder in ``runs``; trained now if it is missing or was cut short.

        Raises:
            SystemExit: training failed.
        """
        folder = runs / self.name
        if (folder / "evaluation" / "summary.json").exists():
            return folder
        shutil.rmtree(folder, ignore_errors=True)
        command = ["innerattn", "train", "--preset", self.preset, "--method", self.method]
        command += ["--warm-start", self.warm_start, "--budget", self.budget]
        command += ["--seed", str(self.seed), "--train.threads", "1", *self.options]
        environment = os.environ | {"OMP_NUM_THREADS": "1"}
        done = subprocess.run(
            [*command, "--run-dir", str(folder)], env=environment, capture_output=True, text=True
        )
        if done.returncode:
            sys.exit(f"{folder}: {done.stderr.strip()}")
        print(f"{folder} done", file=sys.stderr)
        return folder


def train_all(wanted: Sequence[Run], runs: Path, workers: int | None = None) -> list[Path]:
    """The folders of all runs wanted, in their order; those missing are trained side by side."""
    with ThreadPoolExecutor(workers or os.cpu_count()) as pool:
        return list(pool.map(lambda run: run.train(runs), wanted))
