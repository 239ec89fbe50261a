"""What keys of bodies and senses cost: env-steps a second with and without them, in one run.

`python benches/key_cost.py` fills its place in `docs/performance.md`. 1,024 mixed worlds, random
discrete actions, all cores, Python call included.
"""

from __future__ import annotations

from typing import Any

from fault_cost import MIXED, shares
from page import machine, publish

from innerattn.config import Communication, Map, RangeSensor, Scenario


def changed(**keys: Any) -> Scenario:
    """The mixed team with keys of every robot."""
    return MIXED.replace(robots=tuple(robot.replace(**keys) for robot in MIXED.robots))


def layered() -> Scenario:
    """The mixed team, whose food robots fly."""
    food, others = MIXED.robots[:2], MIXED.robots[2:]
    return MIXED.replace(robots=(*(robot.replace(layer="air") for robot in food), *others))


def walled() -> Scenario:
    """The mixed team between walls of a map, with a gap of 0.4 m in each."""
    rows = ["#" * 8 + "." * 4 + "#" * 8 if row in (6, 13) else "." * 20 for row in range(20)]
    return MIXED.replace(map=Map(rows=tuple(rows)))


WORLDS = {
    "none": MIXED,
    "two layers": layered(),
    'drive = "velocity"': changed(drive="velocity"),
    'drive = "unicycle"': changed(drive="unicycle"),
    'drive = "differential"': changed(drive="differential"),
    "sight_m = 0.8": changed(sight_m=0.8),
    "16 rays up to 1 m": changed(range_sensor=RangeSensor(rays=16, range_m=1.0)),
    "a map of 20 x 20 cells": walled(),
    "a radio": MIXED.replace(communication=Communication(range_m=0.8, delay_steps=2, loss=0.1)),
    "victims are shared": changed(sight_m=0.8).replace(
        communication=Communication(share="victims")
    ),
}


def main() -> None:
    """Measure and publish."""
    publish("key_cost", f"{machine('numpy')}.\n\n{shares(WORLDS)}")


if __name__ == "__main__":
    main()
