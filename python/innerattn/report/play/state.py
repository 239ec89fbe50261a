"""A world's present state as the JSON that a page gets after each message."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from innerattn.config import Scenario
from innerattn.evaluate.interactive import HEALTHY, MOST_PUSH_MPS, InteractiveWorld
from innerattn.evaluate.moment import Moment
from innerattn.report.worlds import worlds_document

SCHEMA_VERSION = 1
"""Version of what the server sends. A page refuses another one."""

_DECIMALS = 5


def opening_document(session: str, world: InteractiveWorld) -> dict[str, Any]:
    """What a page gets first: its session, the world, the policies, and the state."""
    return state_document(world.moment()) | {
        "session": session,
        "worlds": playable_worlds(world.scenario, world.num_own),
        "policies": list(world.policies),
    }


def playable_worlds(scenario: Scenario, num_own: int | None = None) -> dict[str, Any]:
    """What does not change while a page plays: the worlds, and what hands may do.

    Args:
        scenario: the worlds.
        num_own: as of `InteractiveWorld`; robots behind these are marked as spare.
    """
    reach = np.float32(scenario.arena_half_width_m) - np.float32(scenario.wall_clearance_m)
    worlds = worlds_document(scenario)
    for robot in worlds["robots"][scenario.num_robots if num_own is None else num_own :]:
        robot["is_spare"] = True
    return worlds | {
        "most_push_mps": MOST_PUSH_MPS,
        "victim_reach_m": float(str(reach)),
        "num_victims": scenario.num_victims,
    }


def state_document(moment: Moment) -> dict[str, Any]:
    """A world now, and what happened in the step that led to it."""
    attention = moment.attention
    return {
        "schema_version": SCHEMA_VERSION,
        "episode": moment.episode,
        "step": moment.step,
        "policy": moment.policy,
        "steered": moment.steered,
        "positions": _rounded(moment.positions),
        "velocities": _rounded(moment.velocities),
        "blocked": moment.blocked.tolist(),
        "faults": [_wrong(robot) for robot in moment.faults],
        "headings": None if moment.headings is None else _rounded(moment.headings[:, :1]),
        "charge": None if moment.charge is None else np.round(moment.charge, _DECIMALS).tolist(),
        "load": None if moment.load is None else np.round(moment.load, _DECIMALS).tolist(),
        "heard": None if moment.heard is None else moment.heard.astype(int).tolist(),
        "rays": None if moment.rays is None else _readings(moment.rays),
        "victims": [
            {"slot": slot, "id": int(one["id"]), "task": int(one["task"])}
            | _times(one)
            | {axis: round(float(one[axis]), _DECIMALS) for axis in ("x", "y")}
            for slot, one in enumerate(moment.victims)
            if one["present"]
        ],
        "obstacles": _rounded(moment.obstacles),
        "attention": None if attention is None else np.round(attention, 3).tolist(),
        "rescues": [rescue._asdict() for rescue in moment.rescues],
        "lost": [loss._asdict() for loss in moment.lost],
        "handoffs": [handoff._asdict() for handoff in moment.handoffs],
        "rescued": moment.rescued,
        "helped": list(moment.helped),
    }


def _rounded(values: NDArray[np.float32]) -> list[list[float]]:
    return np.round(values.astype(np.float64), _DECIMALS).tolist()  # type: ignore[no-any-return]


def _readings(rays: NDArray[np.float32]) -> list[list[float]]:
    """Readings of range sensors, rounded up: only a ray that meets nothing is 0."""
    up = np.ceil(rays.astype(np.float64) * 10**_DECIMALS) / 10**_DECIMALS
    return up.tolist()  # type: ignore[no-any-return]


def _times(victim: np.void) -> dict[str, float | int]:
    """A victim's share of its service, when it is lost, and if it waits, where there is such."""
    names = victim.dtype.names or ()
    served = {"served": round(float(victim["served"]), 3)} if "served" in names else {}
    due = {"deadline": int(victim["deadline_step"])} if "deadline_step" in names else {}
    waits = {"waits": bool(victim["blocked"])} if "blocked" in names else {}
    return {**served, **due, **waits}


def _wrong(robot: np.void) -> dict[str, float]:
    """What is wrong with a robot, by kind."""
    values = {kind: float(robot[kind]) for kind in HEALTHY}
    return {
        kind: round(v, _DECIMALS) for kind, v in values.items() if v != np.float32(HEALTHY[kind])
    }
