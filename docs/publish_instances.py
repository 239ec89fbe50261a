"""Makes the worlds of the set `standard` and lists them in `docs/instances.md`.

`python docs/publish_instances.py` draws 300 worlds if their file is not there, and lets scripts and
the policy for any team play them. It takes some twenty minutes of one core. `SEED` fixes the
worlds; one that no script does well enough in is drawn anew.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from innerattn.config import Scenario
from innerattn.config import instances as package
from innerattn.config.files import write_whole
from innerattn.config.instances import SHIPPED, WorldInstance, read_worlds
from innerattn.errors import ConfigError
from innerattn.evaluate.instance_worlds import REFERENCES, evaluate_worlds, with_reference
from innerattn.report.marks import fill
from innerattn.report.tables.instances import worlds_markdown

PAGE = Path(__file__).parent / "instances.md"
WORLDS_FILE = Path(package.__file__).parent / SHIPPED["standard"]
SEED = 20_261_128
SIZES = {2: 6, 4: 10, 8: 16, 16: 24, 32: 32, 64: 32}
"""Robots of a team, and its victims."""
OF_EACH = 5
"""Worlds of each size with each feature."""
ENOUGH = 0.6
"""Least share of victims that the reference rescues where some can be lost; elsewhere all."""

Values = dict[str, Any]
Draw = Callable[[np.random.Generator, Values], None]


def plain(rng: np.random.Generator, robots: int) -> Values:
    """A team at fixed places, and all victims there from the start."""
    half = round(max(0.8, 0.5 * robots**0.5), 1)
    abilities = [f"ability_{index}" for index in range(min(robots, 5, 2 + robots // 4))]
    types = min(4, robots)
    places = iter(_apart(rng, robots + SIZES[robots], half - 0.15))
    team = []
    for index in range(robots):
        own = {abilities[index % len(abilities)]}
        if rng.random() < 0.25:
            own.add(str(rng.choice(abilities)))
        team.append(
            {
                "name": f"robot_{index}",
                "kind": f"kind_{index % len(abilities)}",
                "abilities": sorted(own),
                "max_speed_mps": _value(rng, 0.6, 1.6),
                "mass_kg": _value(rng, 0.5, 1.5),
                "start_m": next(places),
            }
        )
    return {
        "situation": "listed",
        "end_when_done": True,
        "episode_steps": 1_000,
        "arena_half_width_m": half,
        "max_victims": 32 // types,
        "robots": team,
        "tasks": [
            {
                "name": f"task_{index}",
                "needs": _some(rng, abilities, int(rng.integers(1, min(3, len(abilities)) + 1))),
            }
            for index in range(types)
        ],
        "arrivals": [
            {"at_s": 0.0, "task": f"task_{index % types}", "position_m": next(places)}
            for index in range(SIZES[robots])
        ],
    }


def service(rng: np.random.Generator, values: Values) -> None:
    """Victims need time; helpers of every other task begin anew when one leaves."""
    for index, task in enumerate(values["tasks"]):
        task["service_s"] = _value(rng, 0.5, 3.0)
        task["service"] = ("keep", "restart")[index % 2]


def deadlines(rng: np.random.Generator, values: Values) -> None:
    """Victims are lost when their time is up."""
    for task in values["tasks"]:
        task["deadline_s"] = round(_value(rng, 1.0, 5.0) + task.get("service_s", 0.0), 2)


def order(rng: np.random.Generator, values: Values) -> None:
    """Each task but the first comes after one before it."""
    for index, task in enumerate(values["tasks"][1:]):
        task["after"] = [f"task_{int(rng.integers(index + 1))}"]


def arrivals(rng: np.random.Generator, values: Values) -> None:
    """Victims arrive in the course of some seconds, more of them in larger arenas."""
    latest = 4.0 * values["arena_half_width_m"]
    times = np.sort(rng.uniform(0.0, latest, len(values["arrivals"])))
    for one, time in zip(values["arrivals"], times, strict=True):
        one["at_s"] = round(float(time), 1)


def sums(rng: np.random.Generator, values: Values) -> None:
    """Robots have amounts; what helpers bring together counts."""
    total: dict[str, float] = {}
    for robot in values["robots"]:
        robot["abilities"] = {name: _value(rng, 0.4, 2.0) for name in robot["abilities"]}
        for name, amount in robot["abilities"].items():
            total[name] = total.get(name, 0.0) + amount
    for task in values["tasks"]:
        task["needs"] = {
            name: round(min(_value(rng, 0.4, 2.5), 0.9 * total[name]), 2)
            for name in task["needs"][:2]
        }


def batteries(rng: np.random.Generator, values: Values) -> None:
    """Two robots of three need energy; there are stations."""
    half = values["arena_half_width_m"]
    for robot in values["robots"]:
        if rng.random() < 2 / 3:
            metres = _value(rng, 4.0 * half, 8.0 * half)
            robot["battery"] = {"capacity_j": round(10.0 * metres, 1), "per_m_j": 10.0}
    values["robots"][0]["battery"] = {"capacity_j": round(50.0 * half, 1), "per_m_j": 10.0}
    values["stations"] = [
        {"position_m": place, "recharge_w": 40.0} for place in _places(rng, values)
    ]


def loads(rng: np.random.Generator, values: Values) -> None:
    """Each robot helps with up to three rescues; then it needs a depot."""
    for robot in values["robots"]:
        robot["load"] = int(rng.integers(1, 4))
    values["depots"] = [{"position_m": place} for place in _places(rng, values)]


def coalitions(rng: np.random.Generator, values: Values) -> None:
    """Each victim needs three to five robots, or both of two."""
    owned = [str(rng.choice(robot["abilities"])) for robot in values["robots"]]
    for task in values["tasks"]:
        most = min(5, len(owned))
        count = int(rng.integers(min(3, most), most + 1))
        task["needs"] = sorted(str(one) for one in rng.choice(owned, count, replace=False))


def together(rng: np.random.Generator, values: Values) -> None:
    """All of it at once."""
    for draw in (service, deadlines, order, arrivals, sums, batteries, loads):
        draw(rng, values)
    for task in values["tasks"]:
        task["deadline_s"] = round(4.0 * task["deadline_s"], 2)


FEATURES: dict[str, tuple[Draw, ...]] = {
    "plain": (),
    **{
        draw.__name__: (draw,)
        for draw in (
            service,
            deadlines,
            order,
            arrivals,
            sums,
            batteries,
            loads,
            coalitions,
            together,
        )
    },
}


def drawn(feature: str, robots: int, number: int, attempt: int) -> Scenario:
    """One world of the set.

    Raises:
        ConfigError: what was drawn is no valid scenario.
    """
    rng = np.random.default_rng([SEED, list(FEATURES).index(feature), robots, number, attempt])
    values = plain(rng, robots)
    for draw in FEATURES[feature]:
        draw(rng, values)
    return Scenario().replace(**values)


def frozen(feature: str, robots: int, number: int) -> WorldInstance:
    """The first world of this number that a script does well enough in, with what it reached."""
    name = f"{feature}_{robots}_{number}"
    for attempt in range(100):
        try:
            scenario = drawn(feature, robots, number, attempt)
        except ConfigError:
            continue
        try:
            world = with_reference(name, feature, scenario)
        except ValueError:  # no script rescues anybody
            continue
        if world.reference.rescued >= (ENOUGH if world.can_lose else 1.0) * world.victims:
            return world
    sys.exit(f"{name}: no script does well enough in any of 100 worlds")


def main() -> None:
    """Make the set if it is not there, then let policies play it and fill the page."""
    if not WORLDS_FILE.exists():
        make()
    worlds = read_worlds("standard")
    results = [evaluate_worlds(policy, worlds) for policy in (*REFERENCES, "zoo:any")]
    fill(PAGE, "standard", worlds_markdown(results))


def make() -> None:
    """Draw all worlds, and write them."""
    names = [
        (feature, robots, number)
        for feature in FEATURES
        for robots in SIZES
        for number in range(OF_EACH)
    ]
    worlds = []
    for done, one in enumerate(names, 1):
        worlds.append(frozen(*one))
        print(f"\r{done} of {len(names)}", end="", flush=True)
    print()
    lines = (json.dumps(one.written(), separators=(",", ":")) for one in worlds)
    write_whole(WORLDS_FILE, ("[\n" + ",\n".join(lines) + "\n]\n").encode())


def _value(rng: np.random.Generator, low: float, high: float) -> float:
    return round(float(rng.uniform(low, high)), 2)


def _some(rng: np.random.Generator, abilities: list[str], count: int) -> list[str]:
    return sorted(str(one) for one in rng.choice(abilities, count, replace=False))


def _apart(rng: np.random.Generator, count: int, half: float) -> list[tuple[float, float]]:
    """Random places in a square, each 0.2 m or more from all others."""
    places: list[tuple[float, float]] = []
    while len(places) < count:
        x, y = (round(float(one), 2) for one in rng.uniform(-half, half, 2))
        if all((x - a) ** 2 + (y - b) ** 2 >= 0.04 for a, b in places):
            places.append((x, y))
    return places


def _places(rng: np.random.Generator, values: Values) -> list[tuple[float, float]]:
    """Of stations or depots: one for each sixteen robots or less."""
    half = values["arena_half_width_m"] - 0.2
    return _apart(rng, 1 + len(values["robots"]) // 16, half)


if __name__ == "__main__":
    main()
