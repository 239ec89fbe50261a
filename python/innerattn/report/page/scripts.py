"""Scripts that a page can compute, and what it must know of a scenario for them.

`web/scripts.js` drives straight to victims as `innerattn.policies.scripted` does. Worlds in which
that takes more (ways around obstacles, wheels, times, batteries, loads, amounts) have `random`
alone.
"""

from __future__ import annotations

from typing import Any

from innerattn.config import Scenario
from innerattn.errors import ConfigError
from innerattn.policies import SCRIPTED
from innerattn.policies.scripted.assignment import Needs
from innerattn.policies.scripted.steering import Steering


def page_scripts(scenario: Scenario) -> tuple[str, ...]:
    """The scripts that a page can compute in the worlds of ``scenario``."""
    winding = scenario.blocks_ways or scenario.has_wheels
    return ("random",) if winding or scenario.asks_for_plans else SCRIPTED


def script_document(name: str, scenario: Scenario) -> dict[str, Any]:
    """What a page must know for a script.

    Raises:
        ConfigError: it cannot compute this one here.
    """
    able = page_scripts(scenario)
    if name not in able:
        raise ConfigError(f"{name}: a page has no such script here; must be {' or '.join(able)}")
    return {} if name == "random" else {"motion": _motion(scenario)}


def _motion(scenario: Scenario) -> dict[str, Any]:
    """How robots move, and who can give what victims need."""
    needs, steering = Needs(scenario), Steering(scenario)
    robots = [
        {
            "able": needs.able[index].tolist(),
            "keep": robot.kept(scenario.damping),
            "push": robot.gain_mps(scenario.dt_s),
            "limit": robot.max_speed_mps,
            "speed": float(steering.speed[index]),
            "lag": float(steering.lag[index]),
        }
        for index, robot in enumerate(scenario.robots)
    ]
    return {
        "robots": robots,
        "needs": needs.of_task.tolist(),
        "dt": scenario.dt_s,
        "radius": scenario.rescue_radius_m,
    }
