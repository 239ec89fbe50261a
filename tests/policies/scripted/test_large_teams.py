"""Scripts where victims need many robots: whole teams are formed, one victim after the other."""

from typing import Any

import pytest

from innerattn.config import SCENARIOS, Scenario
from innerattn.config.instances import WorldInstance, read_any
from innerattn.evaluate.play import run_episodes
from innerattn.policies.scripted.assignment import Needs
from innerattn.policies.scripted.dispatch import scripted_policy
from innerattn.report.page.scripts import page_scripts

SIX = {"name": "six", "needs": ["lift"] * 6}
SUM = {"name": "sum", "needs": {"lift": 6.0}}


def lifting(robots: int, *tasks: dict[str, Any], **more: Any) -> Scenario:
    """Robots of one ability, at waves of up to four victims that take many of them."""
    robot = {"kind": "lifter", "abilities": {"lift": 1.0}, "max_speed_mps": 1.0, "mass_kg": 0.5}
    return Scenario.model_validate(
        {
            "robots": [{"name": f"lifter_{index}", **robot} for index in range(robots)],
            "tasks": tasks,
            "max_victims": 4,
            "engine": "discs",
            "rescue_radius_m": 0.3,
            "arena_half_width_m": 2.0,
            "episode_steps": 200,
            **more,
        }
    )


@pytest.mark.parametrize("name", ["hungarian", "oracle"])
@pytest.mark.parametrize(
    ("scenario", "least"),
    [
        (lifting(12, SIX), 14),
        (lifting(8, SIX), 6),
        (lifting(6, SIX), 6),
        (lifting(8, SIX, SUM), 6),
        (lifting(8, {**SIX, "service_s": 0.5}), 5),
        (lifting(8, SIX, {"name": "later", "needs": ["lift"] * 6, "after": ["six"]}), 6),
    ],
)
def test_nobody_waits_for_those_who_wait_elsewhere(
    scenario: Scenario, least: int, name: str
) -> None:
    record = run_episodes(scripted_policy(name, scenario), scenario, 20, 7)
    assert record.rescue_counts().min() >= least


def test_no_scenario_of_the_package_has_such_teams() -> None:
    """What scripts do in them is as it was measured."""
    scenarios = [Scenario.preset(name) for name in SCENARIOS]
    scenarios += [one.scenario for one in read_any("standard") if isinstance(one, WorldInstance)]
    assert len(scenarios) > 300
    assert not any(Needs(one).has_large_teams for one in scenarios)
    assert Needs(lifting(6, SIX)).has_large_teams


def test_a_page_does_not_have_the_script_there() -> None:
    needs = [["lift"] * count for count in (5, 6)]
    plain = {"kind": "lifter", "abilities": ["lift"], "max_speed_mps": 1.0, "mass_kg": 0.5}
    robots = [{"name": f"lifter_{index}", **plain} for index in range(6)]
    worlds = lifting(6, SIX).replace(robots=robots)
    five, six = (worlds.replace(tasks=[{"name": "a", "needs": one}]) for one in needs)
    assert page_scripts(five) == ("random", "greedy", "hungarian")
    assert page_scripts(six) == ("random", "greedy")
