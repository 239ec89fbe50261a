"""Rescues of policies when a robot fails: every kind of fault, severity, robot and onset.

The worlds are the same for all policies and faults, and the same as without a fault, so that every
comparison is paired; a policy that draws its actions begins with the same draws each time. Trained
actors are frozen: no policy learns from a fault.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from innerattn.config import Scenario
from innerattn.envs.batch import FAULT_KINDS
from innerattn.evaluate.faults.severity import fault_of
from innerattn.evaluate.play import run_episodes
from innerattn.measures.faults.retention import area, mean_rescues, retention
from innerattn.policies import Policy
from innerattn.records.record import Record
from innerattn.stats.bootstrap import Resampled, resampled_counts

SEVERITIES = (0.25, 0.5, 0.75, 1.0)
"""From harmless (0, which needs no measuring) to the worst (1)."""
ONSETS = ("start", "middle")
"""When a fault begins: with the episode, or when half of it is over."""

RESAMPLES = 2000
"""Of the bootstrap that all policies of a grid share."""

ProgressCall = Callable[[int, int], None]
"""Called with the episodes done and the episodes to do."""


@dataclass(frozen=True)
class Grid:
    """The faults that are tried.

    Attributes:
        scenario: the worlds, without faults of their own; `episode_steps` is T.
        kinds: K kinds of faults.
        severities: S severities, rising.
        episodes: E worlds.
        seed: of the worlds and of resampling.
    """

    scenario: Scenario
    kinds: tuple[str, ...] = FAULT_KINDS
    severities: tuple[float, ...] = SEVERITIES
    episodes: int = 100
    seed: int = 0

    @property
    def shape(self) -> tuple[int, int, int, int]:
        """(K, S, R, O): kinds, severities, robots, onsets."""
        return len(self.kinds), len(self.severities), self.scenario.num_robots, len(ONSETS)

    @property
    def middle(self) -> int:
        """The control step at which faults of the second onset begin."""
        return self.scenario.episode_steps // 2

    def worlds(self, kind: str, severity: float, robot: int, onset: str) -> Scenario:
        """The scenario with one fault."""
        onset_step = self.middle if onset == "middle" else 0
        fault = fault_of(self.scenario, robot, kind, severity, onset_step)
        return self.scenario.replace(faults=(fault,))


@dataclass(frozen=True)
class RescueCounts:
    """Rescues of one policy, step by step.

    Attributes:
        clean: (E, T) int64 rescues by world and control step, without a fault.
        faulty: (K, S, R, O, E, T) int16 the same with each fault.
    """

    clean: NDArray[np.int64]
    faulty: NDArray[np.int16]


def play(
    policy: Policy,
    grid: Grid,
    *,
    num_threads: int | None = None,
    progress: Callable[[int], None] | None = None,
) -> RescueCounts:
    """Run a policy without and with every fault of the grid.

    Args:
        policy: what drives the robots; it is reset before each fault.
        grid: the worlds and the faults.
        num_threads: threads that step the worlds; none: all cores.
        progress: called with the number of episodes each time some are done.
    """

    def rescues(worlds: Scenario) -> NDArray[np.int64]:
        record = run_episodes(policy, worlds, grid.episodes, grid.seed, num_threads=num_threads)
        if progress is not None:
            progress(grid.episodes)
        return rescues_by_step(record)

    clean = rescues(grid.scenario)
    faulty = np.zeros((*grid.shape, *clean.shape), np.int16)
    for k, kind in enumerate(grid.kinds):
        for s, severity in enumerate(grid.severities):
            for robot in range(grid.scenario.num_robots):
                for o, onset in enumerate(ONSETS):
                    worlds = grid.worlds(kind, severity, robot, onset)
                    faulty[k, s, robot, o] = rescues(worlds)
    return RescueCounts(clean, faulty)


def rescues_by_step(record: Record) -> NDArray[np.int64]:
    """Rescues of each episode and control step, (E, T)."""
    counts = np.zeros((record.num_episodes, record.scenario.episode_steps), np.int64)
    events = record.rescues
    np.add.at(counts, (events["episode"] - record.first_episode, events["step"]), 1)
    return counts


@dataclass(frozen=True)
class Window:
    """Rescues and retention in the same steps of every episode, with faults of one onset.

    Attributes:
        clean: () rescues per episode without a fault.
        rescues: (K, S, R) rescues per episode with each fault.
        retention: (K, S, R) their ratio.
    """

    clean: Resampled
    rescues: Resampled
    retention: Resampled


@dataclass(frozen=True)
class Retention:
    """What a policy achieves under faults, and the share of its rescues that it retains.

    Attributes:
        start: the whole episode, with faults from the start.
        middle: from the middle of the episode on, with faults from there.
        early: the first half of ``middle``.
        late: the second half of ``middle``.
        cells: (K, S, R, O) retention since the fault's onset: of ``start`` and of ``middle``.
        areas: (K, R, O) mean retention over severities from 0 to the last.
        rescues_by_kind: (K,) rescues per episode with a fault from the start, a mean over
            severities from 0 to the last and robots.
    """

    start: Window
    middle: Window
    early: Window
    late: Window
    cells: Resampled
    areas: Resampled
    rescues_by_kind: Resampled

    @property
    def clean(self) -> Resampled:
        """Rescues per episode without a fault."""
        return self.start.clean

    def by_kind(self) -> Resampled:
        """Mean of the areas over robots and onsets, (K,)."""
        return self.areas.mean((1, 2))


def retention_of(counts: RescueCounts, grid: Grid) -> Retention:
    """The retention of one policy; all policies of a grid share the resamples."""
    weights = resampled_counts(grid.episodes, grid.seed, RESAMPLES)
    severities = np.asarray(grid.severities)
    steps = counts.clean.shape[1]
    half = grid.middle + (steps - grid.middle) // 2

    def window(first: int, last: int, onset: int) -> Window:
        clean = counts.clean[:, first:last].sum(-1)
        faulty = counts.faulty[:, :, :, onset, :, first:last].sum(-1)
        return Window(
            mean_rescues(clean, weights),
            mean_rescues(faulty, weights),
            retention(faulty, clean, weights),
        )

    start, middle = window(0, steps, 0), window(grid.middle, steps, 1)
    parts = (start.retention, middle.retention)
    cells = Resampled(
        np.stack([part.value for part in parts], 3), np.stack([part.resampled for part in parts], 3)
    )
    return Retention(
        start=start,
        middle=middle,
        early=window(grid.middle, half, 1),
        late=window(half, steps, 1),
        cells=cells,
        areas=area(cells, severities, axis=1),
        rescues_by_kind=area(start.rescues, severities, axis=1, intact=start.clean).mean(1),
    )


def play_all(
    policies: Sequence[tuple[str, Policy]],
    grid: Grid,
    *,
    num_threads: int | None = None,
    progress: ProgressCall | None = None,
) -> dict[str, Retention]:
    """Run policies through the grid, in the same worlds.

    Args:
        policies: names and policies.
        grid: the worlds and the faults.
        num_threads: threads that step the worlds; none: all cores.
        progress: called each time some episodes are done.

    Returns:
        What each retains, by name.
    """
    total = len(policies) * grid.episodes * (1 + math.prod(grid.shape))
    done = 0

    def count(episodes: int) -> None:
        nonlocal done
        done += episodes
        if progress is not None:
            progress(done, total)

    retained = {}
    for name, policy in policies:
        counts = play(policy, grid, num_threads=num_threads, progress=count)
        retained[name] = retention_of(counts, grid)
    return retained
