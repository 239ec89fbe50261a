"""Permutation tests, by `scipy.stats.permutation_test`; exact where permutations are few."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_CHUNK = 2**17  # numbers permuted at once


class PermutationTest(NamedTuple):
    """The result of a permutation test.

    Attributes:
        p: where permutations are drawn, the observed one counts among them, so that p is never 0.
        null: (B,) the statistic of each permutation.
    """

    p: float
    null: Array


def permutation_test(
    samples: Sequence[Array],
    statistic: Callable[..., Array],
    kind: Literal["samples", "pairings"],
    seed: int,
    permutations: int,
    alternative: Literal["two-sided", "greater"] = "two-sided",
) -> PermutationTest:
    """Compare a statistic with its values under permutation.

    Args:
        samples: k arrays (n,).
        statistic: takes as many arrays (..., n) and ``axis=-1``, gives (...).
        kind: "samples" exchanges the k values of each of the n observations, or changes their sign
            where k is 1; "pairings" permutes the n observations of each sample.
        seed: seed of the permutations.
        permutations: how many to draw, B; where there are no more, all are taken instead.
        alternative: "two-sided", with twice the smaller one-sided p-value and at most 1; or
            "greater", with the share of permutations whose statistic is at least the observed one.
    """
    from scipy.stats import permutation_test as test

    result = test(
        samples,
        statistic,
        permutation_type=kind,
        vectorized=True,
        n_resamples=permutations,
        batch=max(1, _CHUNK // sum(map(len, samples))),
        alternative=alternative,
        rng=seed,
    )
    return PermutationTest(float(result.pvalue), np.asarray(result.null_distribution))
