"""Is a task's work shared evenly by two robots? From rescues by episode, with three answers.

χ² cannot show evenness, only fail to see imbalance, and takes rescues for independent; an
equivalence test and an interval over whole episodes or runs can show either.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from innerattn.measures.cooperation import columns_of_choices, shared_abilities
from innerattn.records.record import Record
from innerattn.stats import Estimate
from innerattn.stats.bootstrap import RESAMPLES, percentile_interval
from innerattn.stats.clusters import share_of
from innerattn.stats.student import equivalence_p, student_interval

MARGIN = (0.4, 0.6)
"""Shares between which sharing counts as even, 0.5 ± 0.1."""

ALPHA = 0.05
"""Level of every test."""

Verdict = Literal["even", "uneven", "undecided"]
"""even: the equivalence test passes, which is that the 90 % interval lies within `MARGIN`; uneven:
the 95 % interval lies outside `MARGIN`; undecided: neither."""


@dataclass(frozen=True)
class ChiSquared:
    """Pearson's χ² against equal numbers, 1 degree of freedom, rescues taken for independent."""

    statistic: float
    p: float
    rejected: bool


@dataclass(frozen=True)
class Evenness:
    """How evenly two robots share the rescues of a task in one run.

    Attributes:
        rescues: by the first and the second robot.
        episodes: how many; those without rescues count here only.
        chi_squared: None without rescues.
        share: of the first robot and its 95 % interval, see `clusters.Share`; None without rescues.
        interval_90: low and high end of the 90 % interval of the same form.
        equivalence_p: p-value of the two one-sided tests (the larger) against a share at or
            beyond an end of `MARGIN`.
        verdict: undecided without rescues.
    """

    rescues: tuple[int, int]
    episodes: int
    chi_squared: ChiSquared | None
    share: Estimate | None
    interval_90: tuple[float, float] | None
    equivalence_p: float | None
    verdict: Verdict


@dataclass(frozen=True)
class EvennessOfRuns:
    """How evenly two robots share the rescues of a task in several runs of one method.

    The unit is the run: equal robots have a mean share of 0.5 over endless runs even if every run
    leaves all work to one of them, so read ``runs`` and ``verdicts`` first.

    Attributes:
        runs: each run by itself.
        verdicts: number of runs by their own verdict.
        rescues: of all runs, by the first and the second robot.
        chi_squared: of these numbers; None without rescues.
        share: mean of the runs' shares of the first robot and Student's 95 % interval with the run
            as the unit; None where less than two runs have rescues, or all have the same share,
            which leaves no scatter to judge by.
        interval_90: low and high end of Student's 90 % interval.
        equivalence_p: as in `Evenness`, by Student's t over runs.
        pooled_share: share of the first robot in the rescues of all runs, and the percentile
            interval of a bootstrap that resamples runs and, in each drawn, episodes; None
            without rescues. It is for comparison: of few runs it is too short.
        verdict: by Student's intervals; undecided without them.
    """

    runs: tuple[Evenness, ...]
    verdicts: dict[Verdict, int]
    rescues: tuple[int, int]
    chi_squared: ChiSquared | None
    share: Estimate | None
    interval_90: tuple[float, float] | None
    equivalence_p: float | None
    pooled_share: Estimate | None
    verdict: Verdict


def counts_by_episode(record: Record) -> dict[str, NDArray[np.int64]]:
    """Rescues of each task by episode and by robot that helped where another could have.

    Returns:
        By task (E, K) int64; its columns are the robots that `count_cooperation` names.
    """
    scenario, events = record.scenario, record.rescues
    shared = set(shared_abilities(scenario))
    counts = {}
    for index, task in enumerate(scenario.tasks):
        of_task = events[events["task"] == index]
        total = np.zeros((record.num_episodes, scenario.num_robots), np.int64)
        for name in columns_of_choices(task, shared, events):
            some = of_task[of_task[name] >= 0]
            np.add.at(total, (some["episode"] - record.first_episode, some[name]), 1)
        chosen = shared & set(task.needs)
        able = [bool(chosen & set(robot.abilities)) for robot in scenario.robots]
        counts[task.name] = total[:, able]
    return counts


def evenness(counts: ArrayLike) -> Evenness:
    """How evenly two robots share the rescues of one run; episodes are the unit.

    Args:
        counts: (E, 2) integers, a task's rescues in each episode by the first and second robot.

    Raises:
        ValueError: the counts are not of this shape, not whole, or negative.
    """
    by_episode = _checked(counts)
    share = share_of(by_episode[:, 0], by_episode.sum(1))
    first, second = by_episode.sum(0).tolist()
    if share is None:
        return Evenness((0, 0), len(by_episode), None, None, None, None, "undecided")
    inner, outer = share.estimate(1.0 - 2.0 * ALPHA), share.estimate(1.0 - ALPHA)
    return Evenness(
        rescues=(first, second),
        episodes=len(by_episode),
        chi_squared=_chi_squared(first, second),
        share=outer,
        interval_90=(inner.low, inner.high),
        equivalence_p=max(share.p_above(MARGIN[0]), share.p_below(MARGIN[1])),
        verdict=_verdict(inner, outer),
    )


def evenness_of_runs(runs: Sequence[ArrayLike], seed: int) -> EvennessOfRuns:
    """How evenly two robots share the rescues of several runs; runs are the unit.

    Args:
        runs: for each run (E, 2) integers as for `evenness`.
        seed: seed of the resampling.

    Raises:
        ValueError: there are less than two runs, or counts are not as they must be.
    """
    if len(runs) < 2:
        raise ValueError(f"{len(runs)} run: evenness over runs needs at least 2")
    counts = [_checked(run) for run in runs]
    each = tuple(evenness(run) for run in counts)
    first, second = np.sum([run.sum(0) for run in counts], 0).tolist()
    verdicts: dict[Verdict, int] = {"even": 0, "uneven": 0, "undecided": 0}
    for run in each:
        verdicts[run.verdict] += 1
    shares = [run.share.mean for run in each if run.share is not None]
    outer = inner = p = None
    if len(set(shares)) > 1:
        outer, inner = student_interval(shares), student_interval(shares, 1.0 - 2.0 * ALPHA)
        p = equivalence_p(shares, *MARGIN)
    return EvennessOfRuns(
        runs=each,
        verdicts=verdicts,
        rescues=(first, second),
        chi_squared=_chi_squared(first, second) if first + second else None,
        share=outer,
        interval_90=(inner.low, inner.high) if inner else None,
        equivalence_p=p,
        pooled_share=_pooled(counts, seed),
        verdict=_verdict(inner, outer) if inner and outer else "undecided",
    )


def _checked(counts: ArrayLike) -> NDArray[np.int64]:
    array = np.asarray(counts)
    shaped = array.ndim == 2 and array.shape[1] == 2 and len(array) > 0
    if not shaped or array.dtype.kind not in "iu" or array.min() < 0:
        raise ValueError(
            f"counts of shape {array.shape}, dtype {array.dtype}: must be (E, 2) for one E >= 1, "
            "whole numbers, 0 or more"
        )
    return array.astype(np.int64)


def _chi_squared(first: int, second: int) -> ChiSquared:
    from scipy.stats import chisquare

    test = chisquare([first, second])
    return ChiSquared(float(test.statistic), float(test.pvalue), bool(test.pvalue < ALPHA))


def _verdict(inner: Estimate, outer: Estimate) -> Verdict:
    if MARGIN[0] < inner.low and inner.high < MARGIN[1]:
        return "even"
    return "uneven" if outer.high < MARGIN[0] or outer.low > MARGIN[1] else "undecided"


def _pooled(runs: list[NDArray[np.int64]], seed: int) -> Estimate | None:
    """The share in all rescues, by a nested bootstrap of runs and of their episodes."""
    total = np.sum([run.sum(0) for run in runs], 0)
    if not total.sum():
        return None
    rng = np.random.default_rng(seed)
    drawn = rng.integers(0, len(runs), (RESAMPLES, len(runs)))
    sums = np.empty((*drawn.shape, 2))
    for index, run in enumerate(runs):
        times = drawn == index
        episodes = np.random.default_rng(int(rng.integers(2**32)))
        rows = episodes.integers(0, len(run), (int(times.sum()), len(run)))
        both = (run[:, 0] + (run[:, 1] << 32))[rows].sum(1)  # two counts in one number
        sums[times] = np.stack([both & 0xFFFFFFFF, both >> 32], 1)
    first, all_ = sums[..., 0].sum(1), sums.sum((1, 2))
    return percentile_interval(total[0] / total.sum(), first[all_ > 0] / all_[all_ > 0])
