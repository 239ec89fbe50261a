"""What trained teams retain when a robot fails, whether bounds hold, and where attention goes.

Each of these is measured elsewhere; here they are put together for several runs.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from innerattn.config import NetworkConfig
from innerattn.envs.batch import FAULT_KINDS
from innerattn.evaluate.bounds.measure import bounds_of_run
from innerattn.evaluate.bounds.results import Bounds
from innerattn.evaluate.faults.attention import fault_attention_of_run
from innerattn.evaluate.faults.document import robustness_document
from innerattn.evaluate.faults.grid import Grid, Retention, play_all
from innerattn.evaluate.trained import load_trained
from innerattn.measures.faults.shift_results import FaultAttention
from innerattn.policies import Policy, scripted_policy
from innerattn.records.run_folder import read_config
from innerattn.train.build import thread_count, torch_threads

EPISODES = 100
"""Worlds in which each fault is tried."""
SCRIPTS = ("greedy", "hungarian", "oracle")
"""The scripted policies that meet the same faults."""

Stage = Literal["evaluating", "checking bounds", "watching attention"]

ProgressCall = Callable[[Stage, int, int], None]
"""Called with the stage, and what is done and what there is to do of it.

These are episodes of all policies; of a run's bounds, levels; of its attention, plays.
"""


@dataclass(frozen=True)
class Robustness:
    """What was measured.

    Attributes:
        grid: the faults.
        retention: of each policy by name, first the runs in their order, then the scripts.
        methods: method of training of each run, by name.
        bounds: of each run's critic, by name; none for teams of one robot, and of robots with a
            memory or messages.
        attention: of each run with learnt attention, by name; none for teams of less than three.
    """

    grid: Grid
    retention: dict[str, Retention]
    methods: dict[str, str]
    bounds: dict[str, Bounds]
    attention: dict[str, FaultAttention]

    def to_json(self) -> dict[str, Any]:
        """A document of plain values."""
        return {
            **robustness_document(self.grid, self.retention, self.methods),
            "bounds": {name: one.to_json() for name, one in self.bounds.items()},
            "attention": {name: one.to_json() for name, one in self.attention.items()},
        }


def measure_robustness(
    runs: Sequence[str | Path],
    *,
    kinds: Sequence[str] = FAULT_KINDS,
    episodes: int = EPISODES,
    episode_steps: int | None = None,
    seed: int | None = None,
    progress: ProgressCall | None = None,
) -> Robustness:
    """Measure runs; all meet the worlds of the first, without the faults of its training.

    Args:
        runs: run folders, at least one, none of them twice; nothing is written into them.
        kinds: of faults.
        episodes: worlds in which each fault is tried, at least 2.
        episode_steps: length of an episode, at least 2; None: twice that of the first run.
        seed: of the worlds; None: as the first run's configuration says.
        progress: called as the work goes on.

    Raises:
        RunError: there is no readable run, or runs do not fit each other.
        ConfigError: a configuration, or the seed, is not valid.
    """

    def on(stage: Stage) -> Callable[[int, int], None] | None:
        return None if progress is None else lambda done, total: progress(stage, done, total)

    names = run_names(runs)
    config = read_config(runs[0])
    steps = episode_steps or 2 * config.scenario.episode_steps
    worlds_seed = config.evaluate.replace(**({} if seed is None else {"seed": seed})).seed
    scenario = config.scenario.replace(episode_steps=steps, faults=())
    grid = Grid(scenario, kinds=tuple(kinds), episodes=episodes, seed=worlds_seed)
    policies: list[tuple[str, Policy]] = []
    methods: dict[str, str] = {}
    networks: dict[str, NetworkConfig] = {}
    for name, run in zip(names, runs, strict=True):
        trained, policy = load_trained(run, scenario)
        methods[name], networks[name] = trained.train.method, trained.network
        policies.append((name, policy))
    policies += [(name, scripted_policy(name, scenario, worlds_seed)) for name in SCRIPTS]
    with torch_threads(thread_count(config)):
        retention = play_all(
            policies, grid, num_threads=config.train.threads, progress=on("evaluating")
        )
    bounds: dict[str, Bounds] = {}
    if scenario.num_robots > 1:
        for name, run in zip(names, runs, strict=True):
            # Bounds are of what one robot decides by one observation.
            if networks[name].memory_width or networks[name].message_width:
                continue
            bounds[name] = bounds_of_run(run, seed=seed, progress=on("checking bounds"))
    attention: dict[str, FaultAttention] = {}
    if scenario.num_robots > 2:
        for name, run in zip(names, runs, strict=True):
            if networks[name].attention == "inner":  # weights that are not learnt do not move
                attention[name] = fault_attention_of_run(
                    run,
                    kinds=kinds,
                    episodes=episodes,
                    steps=episode_steps,
                    seed=seed,
                    progress=on("watching attention"),
                )
    return Robustness(grid, retention, methods, bounds, attention)


def run_names(runs: Sequence[str | Path]) -> list[str]:
    """A name for each run: the shortest end of its path that no other has, nor a script."""
    paths = [Path(run).resolve() for run in runs]
    taken = [*(path.parts for path in paths), *((script,) for script in SCRIPTS)]

    def named(path: Path) -> str:
        for length in range(1, len(path.parts)):
            end = path.parts[-length:]
            if sum(parts[-length:] == end for parts in taken) == 1:
                return "/".join(end)
        return str(path)

    return [named(path) for path in paths]
