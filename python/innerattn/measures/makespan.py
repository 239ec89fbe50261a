"""How often all victims of a list are done in time, and how soon, from records."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from innerattn.measures.measure import Measure
from innerattn.records.record import Record
from innerattn.stats import Estimate
from innerattn.stats.clusters import ratio_interval, share_of


def done(record: Record) -> Estimate | None:
    """Share of episodes in which every victim of the list was rescued, lost or turned away.

    In the others the time was up before, or enough rescues ended the episode.

    Returns:
        None where episodes do not end when all is done.
    """
    if not record.scenario.end_when_done:
        return None
    share = share_of(_is_done(record), np.ones(record.num_episodes, np.int64))
    return None if share is None else share.estimate()


def makespan_s(record: Record) -> Estimate | None:
    """Mean time at which all victims of the list were done [s], over the episodes where they were.

    It leaves out the slowest episodes where some were not done; `done` says how many were.

    Returns:
        None where less than two episodes were done, or where none ends when all is done.
    """
    if not record.scenario.end_when_done:
        return None
    is_done = _is_done(record)
    return ratio_interval(record.lengths * record.scenario.dt_s * is_done, is_done)


def _is_done(record: Record) -> NDArray[np.int64]:
    """1 for each episode in which all of the list came to an end, else 0."""
    episode = record.lost["episode"] - record.first_episode
    gone = record.rescue_counts() + np.bincount(episode, minlength=record.num_episodes)
    if record.turned_away is not None:
        gone = gone + record.turned_away
    return np.asarray(gone == len(record.scenario.arrivals), np.int64)


MEASURES = (
    Measure(
        name="makespan_s",
        unit="s",
        meaning="mean time at which all victims were done, of episodes in which they were",
        of=makespan_s,
        applies=lambda scenario: scenario.end_when_done,
    ),
    Measure(
        name="done",
        unit="",
        meaning="share of episodes in which all victims were done before the time was up",
        of=done,
        applies=lambda scenario: scenario.end_when_done,
    ),
)
