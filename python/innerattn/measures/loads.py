"""How often loads are used up, and how often depots refill them, from records."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from innerattn.measures.measure import Measure
from innerattn.records.record import Record
from innerattn.stats import Estimate
from innerattn.stats.clusters import ratio_interval


def unloaded(record: Record) -> Estimate | None:
    """Share of steps that a robot began with a load used up, of all robots with one.

    Returns:
        None where there are less than two episodes.
    """
    has = [robot.load is not None for robot in record.scenario.robots]
    load: NDArray[np.float32] = record.steps["load"][..., has]
    played = np.arange(load.shape[1]) < record.lengths[:, None]
    steps = record.lengths * sum(has)
    return ratio_interval(((load == 0.0) & played[..., None]).sum((1, 2)), steps)


def refills(record: Record) -> Estimate | None:
    """How often depots refilled a load in an episode, but for its last step.

    What the last step leaves is not recorded. A load that a rescue used and a depot refilled in the
    same step counts. The interval is over episodes.

    Returns:
        None where there are less than two episodes.
    """
    full = np.array([robot.load or 0 for robot in record.scenario.robots])
    loads = np.rint(record.steps["load"] * full).astype(np.int64)
    used = np.zeros(loads.shape, np.int64)
    rescues = record.rescues
    for name in (name for name in rescues.dtype.names or () if name.startswith("helper_")):
        some = rescues[rescues[name] >= 0]
        place = some["episode"] - record.first_episode, some["step"], some[name]
        np.add.at(used, place, full[some[name]] > 0)
    refilled = loads[:, 1:] > loads[:, :-1] - used[:, :-1]
    counted = np.arange(refilled.shape[1]) < record.lengths[:, None] - 1
    counts = (refilled & counted[..., None]).sum((1, 2))
    return ratio_interval(counts, np.ones(record.num_episodes))


MEASURES = (
    Measure(
        name="unloaded",
        unit="",
        meaning="share of steps in which a robot's load was used up",
        of=unloaded,
        needs=("load",),
        applies=lambda scenario: scenario.has_loads,
    ),
    Measure(
        name="refills",
        unit="",
        meaning="how often depots refilled a load in an episode, but for its last step",
        of=refills,
        needs=("load",),
        applies=lambda scenario: bool(scenario.depots),
    ),
)
