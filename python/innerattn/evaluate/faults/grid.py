"""What policies still achieve when a robot fails: every kind of fault, severity, robot and onset.

The worlds are the same for all policies and faults, and the same as without a fault, so that every
comparison is paired; a policy that draws its actions begins with the same draws each time. Trained
actors are frozen: nobody learns from a fault.
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
from innerattn.measures.faults.retention import area, retention
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
class Played:
    """Rescues of one policy.

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
) -> Played:
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
    return Played(clean, faulty)


def rescues_by_step(record: Record) -> NDArray[np.int64]:
    """Rescues of each episode and control step, (E, T)."""
    counts = np.zeros((record.num_episodes, record.scenario.episode_steps), np.int64)
    events = record.rescues
    np.add.at(counts, (events["episode"] - record.first_episode, events["step"]), 1)
    return counts


@dataclass(frozen=True)
class Retention:
    """How much of its rescues a policy keeps.

    Attributes:
        clean: rescues per episode without a fault.
        cells: (K, S, R, O) retention since the fault's onset.
        areas: (K, R, O) mean retention over severities from 0 to the last.
        early: (K, S, R) retention in the first half of what follows an onset in the middle.
        late: (K, S, R) retention in the second half of it.
    """

    clean: Resampled
    cells: Resampled
    areas: Resampled
    early: Resampled
    late: Resampled

    def by_kind(self) -> Resampled:
        """Mean of the areas over robots and onsets, (K,)."""
        return self.areas.mean((1, 2))


def kept(played: Played, grid: Grid) -> Retention:
    """The retention of one policy; all policies of a grid share the resamples."""
    weights = resampled_counts(grid.episodes, grid.seed, RESAMPLES)
    steps = played.clean.shape[1]
    half = grid.middle + (steps - grid.middle) // 2

    def since(first: int, last: int, onset: slice | int) -> Resampled:
        faulty = played.faulty[:, :, :, onset, :, first:last].sum(-1)
        return retention(faulty, played.clean[:, first:last].sum(-1), weights)

    parts = [since(0, steps, 0), since(grid.middle, steps, 1)]
    cells = Resampled(
        np.stack([part.value for part in parts], 3), np.stack([part.resampled for part in parts], 3)
    )
    totals = played.clean.sum(1)
    return Retention(
        clean=Resampled(np.asarray(totals.mean()), weights @ totals / grid.episodes),
        cells=cells,
        areas=area(cells, np.asarray(grid.severities), axis=1),
        early=since(grid.middle, half, 1),
        late=since(half, steps, 1),
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
        What each keeps, by name.
    """
    total = len(policies) * grid.episodes * (1 + math.prod(grid.shape))
    done = 0

    def count(episodes: int) -> None:
        nonlocal done
        done += episodes
        if progress is not None:
            progress(done, total)

    found = {}
    for name, policy in policies:
        played = play(policy, grid, num_threads=num_threads, progress=count)
        found[name] = kept(played, grid)
    return found
