"""Scripts where robots might wait for each other: whole teams are formed, one after the other."""

from typing import Any

import pytest

from innerattn.config import Scenario
from innerattn.evaluate.play import run_episodes
from innerattn.policies.scripted.dispatch import scripted_policy

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


def test_two_who_wait_for_each_other_form_a_team() -> None:
    """Each digger is nearer to another victim, and each victim needs both."""
    places = {"max_victims": 2, "victim_places_m": [[-1.5, 0.0], [1.5, 0.0], [0.0, 1.5]]}
    worlds = lifting(2, {"name": "two", "needs": ["lift", "lift"]}, **places)
    record = run_episodes(scripted_policy("hungarian", worlds), worlds, 20, 7)
    assert record.rescue_counts().min() >= 5
