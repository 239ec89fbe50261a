"""`innerattn robustness`: what a trained team keeps when a robot fails, and its attention."""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tyro
from rich.console import Console

from innerattn.cli.options import Command, UsageError, check_target
from innerattn.cli.progress import CheckingBounds, Evaluating, WatchingAttention
from innerattn.config.files import write_whole
from innerattn.envs.batch import FAULT_KINDS
from innerattn.report.tables.robustness import print_robustness

if TYPE_CHECKING:
    from innerattn.evaluate.bounds.results import Bounds
    from innerattn.evaluate.faults.grid import Grid, Retention
    from innerattn.measures.faults.shift_results import FaultAttention
    from innerattn.policies import Policy

_SCRIPTED = ("greedy", "hungarian", "oracle")
_MOST = 1_000_000  # episodes, and steps of one


@dataclass(kw_only=True)
class Robustness(Command):
    """Measure what a trained team keeps when a robot fails, beside scripted policies."""

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
    """Write the figures to this file too; - for standard output, and nothing else there."""
    plot: Path | None = None
    """Draw the first run's figures as a heat map into this file (.pdf, .png or .svg)."""

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
        grid, found, methods = self._retention(kinds)
        robots = grid.scenario.num_robots
        bounds = self._bounds() if robots > 1 else {}
        attention = self._attention(kinds, bounds) if robots > 2 else {}
        if robots < 3:
            left_out = "where attention goes" if robots > 1 else "attention, its bounds included"
            why = f"left out: {left_out}, which has no choice in a team of {robots}"
            print(f"innerattn: {why}", file=sys.stderr)
        if self.json != Path("-"):
            console = Console(markup=False, highlight=False)
            print_robustness(console, grid, found, bounds, attention)
        if self.json is not None:
            parts = _document(grid, found, methods, bounds, attention)
            document = json.dumps(parts, indent=1, allow_nan=False)
            if self.json == Path("-"):
                print(document)
            else:
                write_whole(self.json, f"{document}\n".encode())
        if self.plot is not None:
            from innerattn.report.plots.heatmap import write_heatmap

            first = next(iter(found))
            write_heatmap(self.plot, first, found[first], grid)
        return 0

    def _check(self) -> tuple[str, ...]:
        """The kinds asked for, once every option has been looked at."""
        if not self.runs:
            raise UsageError("RUN: at least one run is needed")
        folders = [Path(run).resolve() for run in self.runs]
        for index, folder in enumerate(folders):
            if folder in folders[:index]:
                raise UsageError(f"RUN = {self.runs[index]}: is given twice")
        for name, least in (("episodes", 2), ("episode_steps", 2)):
            value = getattr(self, name)
            if value is not None and not least <= value <= _MOST:
                flag = name.replace("_", "-")
                raise UsageError(f"--{flag} = {value}: must be {least} to {_MOST:,}")
        for path in (self.json, self.plot):
            if path is not None:
                check_target(path)
        if self.faults == "all":
            return FAULT_KINDS
        kinds = tuple(dict.fromkeys(kind.strip() for kind in self.faults.split(",")))
        unknown = [kind for kind in kinds if kind not in FAULT_KINDS]
        if unknown:
            known = ", ".join(FAULT_KINDS)
            raise UsageError(f"--faults = {unknown[0]!r}: known are all, {known}")
        return kinds

    def _retention(
        self, kinds: tuple[str, ...]
    ) -> tuple[Grid, dict[str, Retention], dict[str, str]]:
        from innerattn.evaluate.faults.grid import Grid, play_all
        from innerattn.evaluate.trained import load_trained
        from innerattn.policies import scripted_policy
        from innerattn.records.run_folder import read_config
        from innerattn.train.build import thread_count, torch_threads

        config = read_config(self.runs[0])
        steps = self.episode_steps or 2 * config.scenario.episode_steps
        given = {} if self.seed is None else {"seed": self.seed}
        seed = config.evaluate.replace(**given).seed
        scenario = config.scenario.replace(episode_steps=steps, faults=())
        grid = Grid(scenario, kinds=kinds, episodes=self.episodes, seed=seed)
        policies: list[tuple[str, Policy]] = []
        methods: dict[str, str] = {}
        for name, run in zip(_names(self.runs), self.runs, strict=True):
            trained, policy = load_trained(run, scenario)
            methods[name] = trained.train.method
            policies.append((name, policy))
        policies += [(name, scripted_policy(name, scenario, seed)) for name in _SCRIPTED]
        with torch_threads(thread_count(config)), Evaluating() as progress:
            found = play_all(policies, grid, num_threads=config.train.threads, progress=progress)
        return grid, found, methods

    def _bounds(self) -> dict[str, Bounds]:
        from innerattn.evaluate.bounds.measure import bounds_of_run

        with CheckingBounds() as progress:
            return {
                name: bounds_of_run(run, seed=self.seed, progress=progress)
                for name, run in zip(_names(self.runs), self.runs, strict=True)
            }

    def _attention(
        self, kinds: tuple[str, ...], bounds: dict[str, Bounds]
    ) -> dict[str, FaultAttention]:
        """Of the runs with learnt attention; weights that are not learnt do not move."""
        from innerattn.evaluate.faults.attention import fault_attention_of_run

        with WatchingAttention() as progress:
            return {
                name: fault_attention_of_run(
                    run,
                    kinds=kinds,
                    episodes=self.episodes,
                    steps=self.episode_steps,
                    seed=self.seed,
                    progress=progress,
                )
                for name, run in zip(_names(self.runs), self.runs, strict=True)
                if bounds[name].attention == "inner"
            }


def _names(runs: Sequence[str]) -> list[str]:
    """A name for each run: the shortest end of its path that no other has, nor a script."""
    paths = [Path(run).resolve() for run in runs]
    taken = [*(path.parts for path in paths), *((script,) for script in _SCRIPTED)]

    def named(path: Path) -> str:
        for length in range(1, len(path.parts)):
            end = path.parts[-length:]
            if sum(parts[-length:] == end for parts in taken) == 1:
                return "/".join(end)
        return str(path)

    return [named(path) for path in paths]


def _document(
    grid: Grid,
    found: dict[str, Retention],
    methods: dict[str, str],
    bounds: dict[str, Bounds],
    attention: dict[str, FaultAttention],
) -> dict[str, Any]:
    from innerattn.evaluate.faults.document import robustness_document

    return {
        **robustness_document(grid, found, methods),
        "bounds": {name: one.to_json() for name, one in bounds.items()},
        "attention": {name: one.to_json() for name, one in attention.items()},
    }
