"""Did the robot go that would have been there sooner? From recorded motion and rescues."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from innerattn.measures.cooperation import shared_abilities
from innerattn.measures.measure import Measure
from innerattn.policies.scripted.steering import Steering
from innerattn.records.record import Record
from innerattn.stats import Estimate
from innerattn.stats.clusters import ratio_interval, share_interval

_NEEDS = ("positions", "velocities", "victims")
_EQUAL_S = 1e-9


@dataclass(frozen=True)
class DispatchQuality:
    """How well the choice of helpers fits arrival times, as estimated when victims appeared.

    A robot may be busy with another victim then, so even the best dispatch does not always send
    the one that would be there sooner; compare with a scripted policy in the same worlds. Robots
    are taken to be healthy: with faults the values say little. They are None without choices, and
    ``regret_s`` is where all choices come from one episode.

    Attributes:
        choices: rescues' needs that several robots could have filled.
        sooner: share of choices in which none of these would have arrived sooner than the helper.
        sooner_by_chance: the same if the helper were drawn from them.
        regret_s: arrival time of the helper minus the least of them [s].
        regret_by_chance_s: the same if the helper were drawn from them [s].
    """

    choices: int
    sooner: Estimate | None
    sooner_by_chance: float | None
    regret_s: Estimate | None
    regret_by_chance_s: float | None


@dataclass(frozen=True)
class Choices:
    """Every choice of a helper.

    Attributes:
        episode: (N,) int64 from 0, position in the record.
        helper: (N,) int64 the robot that helped.
        times: (N, R) float64 arrival times of all robots at the victim, at the step it appeared
            [s]; inf for robots that could not have filled the need.
    """

    episode: NDArray[np.int64]
    helper: NDArray[np.int64]
    times: NDArray[np.float64]


def choices_of(record: Record) -> Choices:
    """Every choice that the team of a record made.

    A need counts if several robots have the ability and the task needs it once; where it is needed
    twice, or where needs are sums, there is no single robot that should have gone.

    Raises:
        ValueError: positions, velocities or victims were not recorded.
    """
    missing = [name for name in _NEEDS if name not in record.steps]
    if missing:
        raise ValueError(f"record of {record.policy!r} lacks {', '.join(missing)}: record them")
    scenario, rescues = record.scenario, record.rescues
    shared = shared_abilities(scenario)
    parts = []
    for index, task in enumerate(scenario.tasks):
        for need, ability in enumerate(task.roles):
            if ability in shared and task.roles.count(ability) == 1:
                events = rescues[rescues["task"] == index]
                able = np.array([ability in robot.abilities for robot in scenario.robots])
                times = np.where(able, _times(record, events), np.inf)
                episode = events["episode"] - record.first_episode
                parts.append((episode, events[f"helper_{need}"], times))
    if not parts:
        none = np.zeros(0, np.int64)
        return Choices(none, none, np.zeros((0, scenario.num_robots)))
    return Choices(*(np.concatenate(part) for part in zip(*parts, strict=True)))


def dispatch_quality(record: Record) -> DispatchQuality:
    """How well the helpers of a record were chosen.

    Raises:
        ValueError: positions, velocities or victims were not recorded.
    """
    choices = choices_of(record)
    if not len(choices.helper):
        return DispatchQuality(0, None, None, None, None)
    able = np.isfinite(choices.times)
    late = choices.times - choices.times.min(1, keepdims=True)
    regret = np.take_along_axis(late, choices.helper[:, None], 1)[:, 0]
    first = able & (late <= _EQUAL_S)
    by_episode = np.bincount(choices.episode, minlength=record.num_episodes)
    sooner = np.bincount(choices.episode[regret <= _EQUAL_S], minlength=record.num_episodes)
    regrets = np.bincount(choices.episode, regret, record.num_episodes)
    return DispatchQuality(
        choices=len(choices.helper),
        sooner=share_interval(sooner, by_episode),
        sooner_by_chance=float((first.sum(1) / able.sum(1)).mean()),
        regret_s=ratio_interval(regrets, by_episode),
        regret_by_chance_s=float((np.where(able, late, 0.0).sum(1) / able.sum(1)).mean()),
    )


def _times(record: Record, events: NDArray[np.void]) -> NDArray[np.float64]:
    """Arrival times (N, R) of all robots at the victims of ``events`` when these appeared."""
    episode = events["episode"] - record.first_episode
    victim = record.steps["victims"][episode, events["step"], events["slot"]]
    appeared = victim["appeared_step"]
    places = np.stack([victim["x"], victim["y"]], -1)[:, None]
    positions = record.steps["positions"][episode, appeared]
    velocities = record.steps["velocities"][episode, appeared]
    headings = None
    if "headings" in record.steps:
        headings = record.steps["headings"][episode, appeared]
    steering = Steering(record.scenario)
    return steering.arrival_times(positions, velocities, places, headings=headings)[..., 0]


MEASURES = (
    Measure(
        name="choices",
        unit="choices",
        meaning="needs of rescued victims that several robots could have met",
        of=lambda record: dispatch_quality(record).choices,
        needs=_NEEDS,
        is_count=True,
    ),
    Measure(
        name="sooner",
        unit="share of choices",
        meaning="how often no other able robot would have arrived sooner than the helper",
        of=lambda record: dispatch_quality(record).sooner,
        needs=_NEEDS,
    ),
    Measure(
        name="sooner_by_chance",
        unit="share of choices",
        meaning="the same for a helper drawn at random from the able robots",
        of=lambda record: dispatch_quality(record).sooner_by_chance,
        needs=_NEEDS,
    ),
    Measure(
        name="regret_s",
        unit="s",
        meaning="arrival time of the helper minus that of the soonest able robot",
        of=lambda record: dispatch_quality(record).regret_s,
        needs=_NEEDS,
    ),
    Measure(
        name="regret_by_chance_s",
        unit="s",
        meaning="the same for a helper drawn at random from the able robots",
        of=lambda record: dispatch_quality(record).regret_by_chance_s,
        needs=_NEEDS,
    ),
)
