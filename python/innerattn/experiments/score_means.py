"""What runs scored, as means over seeds: of one configuration, or of every method of a study."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from innerattn.experiments.run import FinishedRun, Scores, scores_in
from innerattn.measures.summary import Summary
from innerattn.stats import Estimate
from innerattn.stats.seeds import seed_estimate

TwoLengths = tuple[Scores, Scores]
"""Scores at the standard and at the second length of episodes."""


@dataclass(frozen=True)
class MeanScores:
    """Means over runs at one length of episodes.

    Attributes:
        episode_steps: the length [control steps].
        rescues_per_episode: over all runs.
        score: likewise; None where a run has no score.
    """

    episode_steps: int
    rescues_per_episode: Estimate | None
    score: Estimate | None


@dataclass(frozen=True)
class SeedScores:
    """Runs of one configuration that differ by their seed.

    Attributes:
        situation: of the worlds.
        by_seed: scores of each run; None for a run that failed.
        mean: over the runs that did not fail, at both lengths.
    """

    situation: str
    by_seed: dict[int, TwoLengths | None]
    mean: tuple[MeanScores, MeanScores]


def seed_scores(summaries: Mapping[int, Summary | None]) -> SeedScores | None:
    """Scores by seed, and their mean; None where every run failed.

    Args:
        summaries: of the runs by seed; None for a run that failed.
    """
    found = [summary for summary in summaries.values() if summary is not None]
    if not found:
        return None
    by_seed = {seed: scores_in(one.to_json()) if one else None for seed, one in summaries.items()}
    means = _means([two for two in by_seed.values() if two is not None])
    return SeedScores(found[0].situation, by_seed, means)


def scores_over_runs(runs: Sequence[FinishedRun]) -> tuple[MeanScores, MeanScores]:
    """Means over finished runs, at least one, at both lengths of episodes."""
    return _means([run.scores() for run in runs])


def _means(runs: Sequence[TwoLengths]) -> tuple[MeanScores, MeanScores]:
    return _mean([standard for standard, _ in runs]), _mean([long for _, long in runs])


def _mean(runs: Sequence[Scores]) -> MeanScores:
    scores = [run.score for run in runs]
    return MeanScores(
        runs[0].episode_steps,
        seed_estimate([run.rescues_per_episode for run in runs]),
        None if None in scores else seed_estimate(scores),
    )
