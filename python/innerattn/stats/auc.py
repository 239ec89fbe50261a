"""How well a score tells faulty from healthy: areas under ROC curves, with intervals.

It knows no attention and no fault; which scores are compared is the caller's choice.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from innerattn.stats.bootstrap import percentile_interval
from innerattn.stats.estimate import Estimate


class Comparison(NamedTuple):
    """Pairs of a positive and a negative score, by the episodes that the two come from.

    Attributes:
        wins: (C, E, E) float64, for each of C scores the number of pairs of a positive from
            episode e (row) and a negative from episode f (column) in which the positive is the
            higher; a tie counts half.
        pairs: (E, E) float64, the number of pairs.
    """

    wins: NDArray[np.float64]
    pairs: NDArray[np.float64]

    def plus(self, other: Comparison) -> Comparison:
        """The pairs of both, which are of the same episodes."""
        return Comparison(self.wins + other.wins, self.pairs + other.pairs)


def compare(positive: NDArray[np.float64], negative: NDArray[np.float64]) -> Comparison:
    """Compare every positive score with every negative one.

    Args:
        positive: (E, n, C) n samples of C scores in each episode; NaN, in all C alike, where there
            is no sample.
        negative: (E, m, C) likewise.
    """
    defined = ~np.isnan(positive[..., 0])
    episodes, _, scores = positive.shape
    wins = np.empty((scores, episodes, episodes))
    for score in range(scores):
        higher = positive[..., score]
        for episode, row in enumerate(negative[..., score]):
            lower = np.sort(row[~np.isnan(row)])
            twice = np.searchsorted(lower, higher, "left") + np.searchsorted(lower, higher, "right")
            wins[score, :, episode] = np.where(defined, twice, 0).sum(1) / 2.0
    sizes = defined.sum(1), (~np.isnan(negative[..., 0])).sum(1)
    return Comparison(wins, np.outer(*sizes).astype(np.float64))


def areas(comparison: Comparison, draws: NDArray[np.float64]) -> tuple[Estimate, ...]:
    """Areas under the ROC curves: how often a positive score is above a negative one.

    ``AUC = (number of pairs won + half the ties) / number of pairs``, which is Mann and Whitney's
    U over its greatest value: 1 where every positive is above every negative, 0.5 for scores that
    tell nothing apart, below 0.5 where positives tend to be the lower ones. It is not turned round
    then.

    Args:
        comparison: of C scores in E episodes, each with at least one positive and one negative.
        draws: (S, E) how often each episode is in each resample.

    Returns:
        C areas, their intervals by a bootstrap over episodes.
    """
    drawn_pairs = ((draws @ comparison.pairs) * draws).sum(1)
    total = comparison.pairs.sum()
    return tuple(
        percentile_interval(wins.sum() / total, ((draws @ wins) * draws).sum(1) / drawn_pairs)
        for wins in comparison.wins
    )
