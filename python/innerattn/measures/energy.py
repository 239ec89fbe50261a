"""What batteries give, and how often they are empty, from records."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from innerattn.measures.measure import Measure
from innerattn.records.record import Record
from innerattn.stats import Estimate
from innerattn.stats.clusters import ratio_interval


def energy_j(record: Record) -> Estimate | None:
    """Energy that all batteries together gave in an episode [J], but for its last step.

    Where the robots are after the last step is not recorded. The interval is over episodes.

    Returns:
        None where there are less than two episodes.
    """
    scenario, steps = record.scenario, record.steps
    batteries = [robot.battery for robot in scenario.robots]
    capacity, per_m, idle = (
        np.array([getattr(one, name) if one else 0.0 for one in batteries])
        for name in ("capacity_j", "per_m_j", "idle_w")
    )
    positions = steps["positions"].astype(np.float64)
    way = np.linalg.norm(np.diff(positions, axis=1), axis=-1)
    used = per_m * way + idle * scenario.dt_s
    if scenario.robots_leave:
        used *= steps["faults"]["unavailable"][:, :-1] < 1.0
    used = np.minimum(used, capacity * steps["charge"][:, :-1])
    counted = np.arange(used.shape[1]) < record.lengths[:, None] - 1
    return ratio_interval((used * counted[..., None]).sum((1, 2)), np.ones(record.num_episodes))


def empty(record: Record) -> Estimate | None:
    """Share of steps in which a robot's battery was empty, of all robots with one.

    Returns:
        None where there are less than two episodes.
    """
    has = [robot.battery is not None for robot in record.scenario.robots]
    charge: NDArray[np.float32] = record.steps["charge"][..., has]
    played = np.arange(charge.shape[1]) < record.lengths[:, None]
    steps = record.lengths * sum(has)
    return ratio_interval(((charge == 0.0) & played[..., None]).sum((1, 2)), steps)


MEASURES = (
    Measure(
        name="energy_j",
        unit="J",
        meaning="energy that all batteries gave in an episode, but for its last step",
        of=energy_j,
        needs=("positions", "faults", "charge"),
        applies=lambda scenario: scenario.has_batteries,
    ),
    Measure(
        name="empty",
        unit="",
        meaning="share of steps in which a robot's battery was empty",
        of=empty,
        needs=("charge",),
        applies=lambda scenario: scenario.has_batteries,
    ),
)
