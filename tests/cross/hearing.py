"""Who hears whom, and what is told at once, in float64 and without the compiled worlds' bits."""

from __future__ import annotations

from collections import Counter

import numpy as np
from stepper import Bools, State, Stepper

_SLACK_M = 1e-5
"""Distances that differ by less may be decided by rounding."""


def check_hearing(plain: Stepper, state: State) -> Counter[str]:
    """Hold whom robots hear against who can be heard; counts it."""
    radio = plain.scenario.communication
    assert radio is not None
    there = plain.there(state)
    closed = (state.faults["blackout"] == 1) | (state.faults["lost_communication"] == 1)
    hears = there & ~closed
    robots = hears.shape[1]
    assert not state.heard[~hears].any()
    assert not state.heard[:, np.eye(robots, dtype=bool)].any()
    if radio.delay_steps == 0:
        reach = np.inf if radio.range_m is None else radio.range_m
        ways = state.positions[:, None] - state.positions[:, :, None]
        distance = np.linalg.norm(ways, axis=-1)
        could = hears[:, :, None] & there[:, None] & ~np.eye(robots, dtype=bool)
        could &= distance <= reach
        sure = abs(distance - reach) > _SLACK_M
        assert not (state.heard & ~could & sure).any()
        if radio.loss == 0.0:
            assert (state.heard == could)[sure].all()
    return Counter({"heard": int(state.heard.sum()), "unheard": int((~state.heard).sum())})


def told(plain: Stepper, state: State, seen: Bools) -> Bools:
    """Of which victims each robot is told at once by those whom it hears, (E, R, V).

    Args:
        seen: (E, R, V) what robots see themselves.
    """
    radio = plain.scenario.communication
    if radio is None or radio.share != "victims":
        return np.zeros_like(seen)
    assert radio.delay_steps == 0
    return np.asarray((state.heard[..., None] & seen[:, None]).any(2))
