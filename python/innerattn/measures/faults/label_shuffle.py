"""Is it the failing robot that gains or loses weight, or might it as well be any other?

A permutation test: the label "failing" is dealt anew in every episode.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from innerattn.stats import Estimate
from innerattn.stats.resampling import percentile_interval

SHUFFLES = 4999
"""How often labels are dealt anew; the least p-value is one over one more than that."""

_ROUNDING = 1e-12


def shuffled_labels(
    change: NDArray[np.float64], robot: int, seed: int, shuffles: int = SHUFFLES
) -> tuple[Estimate, float]:
    """The change of the weight on a robot that is called failing by lot.

    In every episode one robot is drawn, the failing one as likely as any other, and the mean change
    of the weight that it gets from its teammates is taken; the row of the robot that really fails
    is left out, since its own sight is what many faults spoil. All who look are asked about the
    same robot: they tend to turn to the same one, and labels drawn for each of them alone would
    make chance look smaller than it is. The weight on the failing robot is a mean over one robot
    more than that on others, so that it varies less, and the test says "significant" less often
    than it might: of 100 times without an effect 2 to 5 with four robots, hardly ever with three.

    Args:
        change: (E, R, R) change of the weight of robot i (row) on robot k, R >= 3.
        robot: the robot j that really fails.
        seed: seed of the lot.
        shuffles: how often labels are dealt.

    Returns:
        The mean over episodes by shuffled labels with its middle 95 %, and the p-value: the share
        of shuffles that lie as far from 0 as the real labels do, these counted among them.

    Raises:
        ValueError: there are fewer than three robots.
    """
    episodes, robots, _ = change.shape
    if robots < 3:
        raise ValueError(f"{robots} robots: labels of teammates need at least 3")
    looks = ~np.eye(robots, dtype=np.bool_)
    looks[robot] = False
    gained = np.where(looks, change, 0.0).sum(1) / looks.sum(0)  # (E, R)
    rng = np.random.default_rng(seed)
    dealt = np.zeros(shuffles)
    for row in gained:
        dealt += row[rng.integers(0, robots, shuffles)]
    dealt /= episodes
    as_far = np.abs(dealt) >= abs(gained[:, robot].mean()) - _ROUNDING
    return percentile_interval(dealt.mean(), dealt), float((1 + as_far.sum()) / (1 + shuffles))
