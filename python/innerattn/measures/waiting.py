"""How long victims wait for their rescue, from records."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from innerattn.measures.measure import Measure
from innerattn.records.record import Record
from innerattn.stats import Estimate
from innerattn.stats.clusters import ratio_interval


@dataclass(frozen=True)
class Waiting:
    """How long victims wait, from the step they appear at to the end of that which rescues them.

    Attributes:
        rescued: how many victims were rescued.
        left: how many still waited when their episode ended; how long they would have is unknown.
            Those that were lost before do not count.
        time_to_rescue_s: mean over those rescued [s]. It is short of the truth where many are left,
            since those that take long are.
        time_per_rescue_s: time waited by all, those left included, for each rescue [s]; the mean
            time to rescue if the chance of it is the same at every moment.

    Intervals are over episodes, None where less than two have rescues.
    """

    rescued: int
    left: int
    time_to_rescue_s: Estimate | None
    time_per_rescue_s: Estimate | None


def waiting(record: Record) -> Waiting:
    """How long the victims of a record waited.

    A victim that appears at the very end of an episode, when no step is left, does not count.

    Raises:
        ValueError: victims were not recorded.
    """
    if "victims" not in record.steps:
        raise ValueError(f"record of {record.policy!r} lacks victims: record them")
    victims, dt = record.steps["victims"], record.scenario.dt_s
    happened = np.arange(victims.shape[1]) < record.lengths[:, None]
    present = victims["present"] & happened[..., None]
    waited = present.sum((1, 2)) * dt  # a victim is there at the start of every step it waits
    ids = np.where(present, victims["id"], -1)
    seen = int((ids.max((1, 2), initial=-1) + 1).sum())  # numbered from 0 in every episode
    rescues, episode = record.rescues, record.rescues["episode"] - record.first_episode
    appeared = victims["appeared_step"][episode, rescues["step"], rescues["slot"]]
    times = np.bincount(episode, (rescues["step"] + 1 - appeared) * dt, record.num_episodes)
    counts = record.rescue_counts()
    return Waiting(
        rescued=len(rescues),
        left=seen - len(rescues) - len(record.lost),
        time_to_rescue_s=ratio_interval(times, counts),
        time_per_rescue_s=ratio_interval(waited, counts),
    )


_NEEDS = ("victims",)

MEASURES = (
    Measure(
        name="rescued",
        unit="victims",
        meaning="victims that were rescued",
        of=lambda record: waiting(record).rescued,
        needs=_NEEDS,
        is_count=True,
    ),
    Measure(
        name="left",
        unit="victims",
        meaning="victims that still waited when their episode ended",
        of=lambda record: waiting(record).left,
        needs=_NEEDS,
        is_count=True,
    ),
    Measure(
        name="time_to_rescue_s",
        unit="s",
        meaning="mean time from the appearance of a rescued victim to its rescue",
        of=lambda record: waiting(record).time_to_rescue_s,
        needs=_NEEDS,
    ),
    Measure(
        name="time_per_rescue_s",
        unit="s",
        meaning="time that all victims waited, divided by the number of rescues",
        of=lambda record: waiting(record).time_per_rescue_s,
        needs=_NEEDS,
    ),
)
