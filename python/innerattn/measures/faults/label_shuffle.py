"""Does the failing robot gain or lose weight more than any other robot would?

A permutation test: in every episode the label "failing" is given to a random robot.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from innerattn.stats.bootstrap import percentile_interval
from innerattn.stats.estimate import Estimate
from innerattn.stats.permutation import permutation_test

SHUFFLES = 4999
"""How often labels are shuffled; with fewer ways to label the robots, each of them is taken."""


def shuffled_labels(
    change: NDArray[np.float64], robot: int, seed: int, shuffles: int = SHUFFLES
) -> tuple[Estimate, float]:
    """The change of the weight on a robot that is labelled failing at random.

    In every episode each robot is as likely to be labelled as any other, and the mean change of the
    weight that it gets from its teammates is taken. The row of the robot that really fails is left
    out, since many faults spoil its own observations. The label is the same for all teammates: they
    tend to turn to the same robot, and independent labels would underestimate chance. The weight on
    the failing robot is a mean over one robot more than that on others, so that it varies less: the
    test is conservative, with three robots very much so.

    Args:
        change: (E, R, R) change of the weight of robot i (row) on robot k, R >= 3.
        robot: the robot j that really fails.
        seed: seed of the shuffles.
        shuffles: how often labels are shuffled.

    Returns:
        The mean over episodes under shuffled labels with its middle 95 %, and the two-sided p-value
        of the true labels.

    Raises:
        ValueError: there are fewer than three robots.
    """
    robots = change.shape[1]
    if robots < 3:
        raise ValueError(f"{robots} robots: labels of teammates need at least 3")
    observers = ~np.eye(robots, dtype=np.bool_)
    observers[robot] = False
    gained = np.where(observers, change, 0.0).sum(1) / observers.sum(0)  # (E, R)

    def mean_of_failing(*samples: NDArray[np.float64], axis: int) -> NDArray[np.float64]:
        return np.asarray(samples[robot].mean(axis))

    test = permutation_test(list(gained.T), mean_of_failing, "samples", seed, shuffles)
    return percentile_interval(test.null.mean(), test.null), test.p
