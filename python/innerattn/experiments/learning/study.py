"""What finished runs of a budget have learnt, and learnt beside uniform attention."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from innerattn.experiments.learning.curves import LearningCurve, learning_curves
from innerattn.experiments.paper.claims import LEAST_PAIRS
from innerattn.experiments.paper.pairs import MARGINS
from innerattn.experiments.run import FinishedRun, Scores, by_method, refuse_unlike
from innerattn.stats import Estimate
from innerattn.stats.comparison import Contrast, contrast
from innerattn.stats.seeds import seed_estimate


@dataclass(frozen=True)
class BySeed:
    """A value of each run, and the mean over those that have it."""

    each: tuple[float | None, ...]
    mean: Estimate | None


@dataclass(frozen=True)
class Learnt:
    """What runs of one method in one situation have learnt.

    Attributes:
        situation: of the worlds.
        trained: the method and the variant, such as "ppo-inner entities".
        seeds: of the runs, which all values are ordered by.
        episode_steps: the standard length of episodes, and the second [control steps].
        rescues: per episode of the standard length.
        score: in episodes of the standard length.
        long_score: in episodes of the second length.
    """

    situation: str
    trained: str
    seeds: tuple[int, ...]
    episode_steps: tuple[int, int]
    rescues: BySeed
    score: BySeed
    long_score: BySeed


@dataclass(frozen=True)
class AttentionDifference:
    """Scores with inner minus those with uniform attention, with the seed as the unit.

    Attributes:
        situation: of the worlds.
        algorithm: such as "td".
        seeds: those that have a run of each.
        score: in episodes of the standard length; None where all seeds have the same difference,
            or fewer than `LEAST_PAIRS` have a score.
        long_score: the same in episodes of the second length.
    """

    situation: str
    algorithm: str
    seeds: tuple[int, ...]
    score: Contrast | None
    long_score: Contrast | None


@dataclass(frozen=True)
class Learning:
    """What runs have learnt.

    Attributes:
        learnt: by method, then situation.
        differences: by algorithm, then situation; of `LEAST_PAIRS` seeds or more.
        curves: courses of training in the same order; empty where a run is archived, since an
            archive holds none.
    """

    learnt: tuple[Learnt, ...]
    differences: tuple[AttentionDifference, ...]
    curves: tuple[LearningCurve, ...]

    @property
    def margin(self) -> float:
        """The largest difference of scores that counts as none."""
        return MARGINS["score"]


def read_learning(runs: Sequence[FinishedRun]) -> Learning:
    """What runs have learnt; they are read only.

    Args:
        runs: finished runs, at least one, of one variant.

    Raises:
        RunError: runs cannot be compared, or metrics cannot be read.
    """
    refuse_unlike(runs)
    groups = _groups(runs)
    archived = any(run.archived for run in runs)
    return Learning(
        learnt=tuple(map(_learnt, groups)),
        differences=tuple(_differences(groups)),
        curves=() if archived else tuple(learning_curves(groups)),
    )


def _groups(runs: Sequence[FinishedRun]) -> list[list[FinishedRun]]:
    """Runs by method, then situation, in the order in which these first appear; by seed within."""
    groups = by_method(runs)
    methods = list(dict.fromkeys(method for _, method in groups))
    situations = list(dict.fromkeys(situation for situation, _ in groups))
    ordered = ((situation, method) for method in methods for situation in situations)
    return [groups[key] for key in ordered if key in groups]


def _learnt(group: Sequence[FinishedRun]) -> Learnt:
    standard, long = zip(*(run.scores() for run in group), strict=True)
    return Learnt(
        situation=group[0].situation,
        trained=group[0].case.trained,
        seeds=tuple(run.seed for run in group),
        episode_steps=(standard[0].episode_steps, long[0].episode_steps),
        rescues=_by_seed([one.rescues_per_episode for one in standard]),
        score=_by_seed([one.score for one in standard]),
        long_score=_by_seed([one.score for one in long]),
    )


def _by_seed(values: Sequence[float | None]) -> BySeed:
    return BySeed(tuple(values), seed_estimate(values))


def _differences(groups: Sequence[Sequence[FinishedRun]]) -> list[AttentionDifference]:
    scores = {
        (group[0].situation, group[0].method): {run.seed: run.scores() for run in group}
        for group in groups
    }
    found = []
    for (situation, method), inner in scores.items():
        algorithm, dash, attention = method.rpartition("-")
        uniform = scores.get((situation, f"{algorithm}-uniform"), {})
        seeds = tuple(sorted(inner.keys() & uniform.keys()))
        if not dash or attention != "inner" or len(seeds) < LEAST_PAIRS:
            continue
        of_each = [
            [(inner[seed][length], uniform[seed][length]) for seed in seeds] for length in (0, 1)
        ]
        found.append(AttentionDifference(situation, algorithm, seeds, *map(_compared, of_each)))
    return found


def _compared(pairs: Sequence[tuple[Scores, Scores]]) -> Contrast | None:
    known = [
        (one.score, other.score)
        for one, other in pairs
        if one.score is not None and other.score is not None
    ]
    return contrast(known, (1.0, -1.0), MARGINS["score"]) if len(known) >= LEAST_PAIRS else None
