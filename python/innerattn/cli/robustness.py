"""`innerattn robustness`: retention when a robot fails, bounds on attention, where it goes."""

from __future__ import annotations

import json
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from innerattn.cli.options import LongCommand, UsageError, check_seed, check_target
from innerattn.cli.progress import MeasuringRobustness
from innerattn.cli.runs import existing_run
from innerattn.config.files import write_whole
from innerattn.config.near import did_you_mean
from innerattn.envs.batch import FAULT_KINDS
from innerattn.report.tables.robustness import print_robustness, robustness_line

if TYPE_CHECKING:
    from innerattn.evaluate.robustness import Robustness as MeasuredRobustness

_PICTURES = (".pdf", ".png", ".svg")
_MOST = 1_000_000  # episodes, and steps of one


@dataclass(kw_only=True)
class Robustness(LongCommand):
    """Measure how many rescues remain when a robot fails, beside scripted policies."""

    runs: Annotated[tyro.conf.Positional[tuple[str, ...]], tyro.conf.arg(metavar="RUN [RUN ...]")]
    """Folders of runs; all meet the worlds of the first, without the faults of its training."""
    faults: str = "all"
    """Kinds of faults, separated by commas."""
    episodes: int = 100
    """Worlds in which each fault is tried."""
    episode_steps: int | None = None
    """Length of an episode [control steps]; None: twice that of the run. Faults begin at the start,
    or when half of it is over."""
    seed: int | None = None
    """Seed of the worlds; None: as the run says."""
    json: Path | None = None
    """Write the results to this file too; - for standard output, and nothing else there."""
    plot: Path | None = None
    """Draw the first run's retention as a heat map into this file (.pdf, .png or .svg)."""

    report: Path | None = None
    """Write a page about the runs with these results (.html), see innerattn report."""

    def run(self) -> int:
        """Measure, print, write.

        Returns:
            The exit code, 0.

        Raises:
            InnerattnError: no such run, runs that do not fit each other, or wrong options.
            OSError: a file cannot be written.
        """
        kinds = self._check()
        if self.plot is not None:
            from innerattn.report.plots.drawing import check_format

            check_format(self.plot)
        self.runs = tuple(str(existing_run(run)) for run in self.runs)
        self._check_once()
        runs = []
        if self.report is not None:
            from innerattn.report.runs.page import read_runs, runs_page

            runs = read_runs([Path(run) for run in self.runs])  # before hours of measuring
        found = self._measure(kinds)
        robots = found.grid.scenario.num_robots
        if robots < 3:
            left_out = "where attention goes" if robots > 1 else "attention, its bounds included"
            why = f"left out: {left_out}, which has no choice in a team of {robots}"
            print(f"innerattn: {why}", file=sys.stderr)
        elif without := found.methods.keys() - found.bounds.keys():
            names = ", ".join(sorted(without))
            why = f"left out: bounds on attention of {names}: its robots have a memory or messages"
            print(f"innerattn: {why}", file=sys.stderr)
        if self.json != Path("-"):
            print_robustness(
                self.console(), found.grid, found.retention, found.bounds, found.attention
            )
        if self.json is not None:
            document = json.dumps(found.to_json(), indent=1, allow_nan=False)
            if self.json == Path("-"):
                print(document)
            else:
                write_whole(self.json, f"{document}\n".encode())
        if self.plot is not None:
            from innerattn.report.plots.heatmap import write_heatmap

            first = next(iter(found.retention))
            write_heatmap(self.plot, first, found.retention[first], found.grid)
        if self.report is not None:
            write_whole(
                self.report, runs_page(runs, found.to_json()).encode(errors="backslashreplace")
            )
        if self.json != Path("-"):
            self.say_result(robustness_line(found.grid, found.retention))
        return 0

    def _check(self) -> tuple[str, ...]:
        """The kinds asked for, once every option has been looked at."""
        if not self.runs:
            raise UsageError("RUN: at least one run is needed")
        for name, least in (("episodes", 2), ("episode_steps", 2)):
            value = getattr(self, name)
            if value is not None and not least <= value <= _MOST:
                flag = name.replace("_", "-")
                raise UsageError(f"--{flag} = {value}: must be {least} to {_MOST:,}")
        check_seed(self.seed)
        for path in (self.json, self.plot, self.report):
            if path is not None:
                check_target(path)
        if self.report is not None and self.report.suffix != ".html":
            raise UsageError(f"--report {self.report}: must end in .html")
        if self.plot is not None and self.plot.suffix not in _PICTURES:
            raise UsageError(f"--plot {self.plot}: must end in one of {', '.join(_PICTURES)}")
        if self.faults == "all":
            return FAULT_KINDS
        kinds = tuple(dict.fromkeys(kind.strip() for kind in self.faults.split(",")))
        unknown = [kind for kind in kinds if kind not in FAULT_KINDS]
        if unknown:
            known = ", ".join(FAULT_KINDS)
            near = did_you_mean(unknown[0], FAULT_KINDS)
            raise UsageError(f"--faults = {unknown[0]!r}: known are all, {known}{near}")
        return kinds

    def _check_once(self) -> None:
        folders = [Path(run).resolve() for run in self.runs]
        for index, folder in enumerate(folders):
            if folder in folders[:index]:
                raise UsageError(f"RUN = {self.runs[index]}: is given twice")

    def _measure(self, kinds: tuple[str, ...]) -> MeasuredRobustness:
        from innerattn.evaluate.robustness import measure_robustness

        with MeasuringRobustness(self.progress_console()) as progress:
            return measure_robustness(
                self.runs,
                kinds=kinds,
                episodes=self.episodes,
                episode_steps=self.episode_steps,
                seed=self.seed,
                progress=progress,
            )
