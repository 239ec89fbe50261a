"""What a team can do, in words."""

from typing import Any

import pytest

from innerattn.config import Arrival, Battery, Scenario, Station
from innerattn.envs.batch import FAULT_KINDS
from innerattn.errors import ConfigError
from innerattn.report.scenario_words import _WHAT, scenario_words


def robot(name: str, radius: float, *abilities: str, force: float = 5.0) -> dict[str, Any]:
    body = {"radius_m": radius, "max_speed_mps": 1.0, "mass_kg": 1.0, "drive_force_n": force}
    return {"name": name, "kind": name, "abilities": list(abilities), **body}


def test_tasks_and_who_can_do_them() -> None:
    lines = scenario_words(Scenario.preset("mixed")).splitlines()
    assert lines == [
        "task_1: food (food_0 or food_1) and medicine (medical_0), together within 0.15 m",
        "task_2: food (food_0 or food_1) and information (navigation_0), together within 0.15 m",
    ]


def test_services_and_deadlines_have_words() -> None:
    first, second = Scenario.preset("mixed").tasks
    tasks = (
        first.replace(service_s=0.4, deadline_s=8.0),
        second.replace(service_s=0.5, service="restart", deadline_s=(4.0, 8.0)),
    )
    one, other = scenario_words(Scenario.preset("mixed").replace(tasks=tasks)).splitlines()
    assert one.endswith("0.15 m, for 0.4 s; if they leave, it goes on later; lost after 8 s")
    assert other.endswith("0.15 m, for 0.5 s; if they leave, it starts anew; lost after 4 to 8 s")


def test_areas_of_tasks_have_words() -> None:
    first, second = Scenario.preset("mixed").tasks
    tasks = (first.replace(area_m=(-0.9, -0.25, 0.0, 0.9), deadline_s=8.0), second)
    one, other = scenario_words(Scenario.preset("mixed").replace(tasks=tasks)).splitlines()
    assert one.endswith("; lost after 8 s; its victims appear from (-0.9, -0.25) to (0, 0.9)")
    assert other.endswith("0.15 m")


def test_a_battery_must_last_to_the_farthest_area_of_a_task() -> None:
    first, *others = Scenario().robots
    near, far = (-0.5, -0.1, 0.0, 0.1), (0.0, 0.0, 0.25, 0.75)
    tasks = tuple(one.replace(area_m=near) for one in Scenario().tasks)
    made = Scenario.model_validate(
        {
            "robots": [first.replace(battery=Battery(capacity_j=1.0, per_m_j=2.0)), *others],
            "stations": [Station(position_m=(0.0, 0.0), recharge_w=2.0)],
            "tasks": tasks,
            "spawn_clearance_m": 0.0,
        }
    )
    assert "back to no station" not in scenario_words(made)
    words = scenario_words(made.replace(tasks=(tasks[0], tasks[1].replace(area_m=far))))
    assert "food_0: from a victim at [0.25, 0.75] its full battery brings it back to" in words


def test_amounts_have_words() -> None:
    robots = [robot.model_dump() for robot in Scenario().robots]
    robots[0]["abilities"] = {"food": 1.5}
    first, second = Scenario().tasks
    tasks = (first.replace(needs={"food": 2.0, "medicine": 1.0}), second)
    made = Scenario().replace(robots=robots, tasks=tasks, rescue_radius_m=0.045)
    lines = scenario_words(made).splitlines()
    assert lines[0] == (
        "task_1: 2 food (of food_0 1.5, food_1 1) and 1 medicine (of medical_0 1), together within "
        "0.045 m"
    )
    assert lines[2].startswith("task_1: helpers hardly meet")
    alone = made.replace(tasks=(first.replace(needs={"food": 1.5}),))
    assert "hardly" not in scenario_words(alone), "one robot is enough"


def test_robots_that_leave_have_words() -> None:
    faults = [{"robot": "food_0", "kind": "unavailable", "value": 1.0, "onset_step": 9}]
    made = Scenario().replace(faults=faults, unavailable_robots="leave")
    assert scenario_words(made).splitlines()[-2:] == [
        "food_0: is out in 100 % of the steps from step 9 on",
        "Robots that are out are not in the arena.",
    ]


def test_batteries_have_words() -> None:
    first, *others = Scenario().robots
    made = Scenario.model_validate(
        {
            "robots": [
                first.replace(battery=Battery(capacity_j=6.0, per_m_j=2.0, idle_w=2.0)),
                others[0].replace(battery=Battery(capacity_j=1.0, per_m_j=2.0)),
                *others[1:],
            ],
            "stations": [Station(position_m=(0.0, 0.0), recharge_w=2.0)],
        }
    )
    lines = scenario_words(made).splitlines()
    assert lines[2:] == [
        "food_0: drives 1.5 m with a full battery",
        "food_1: drives 0.5 m with a full battery",
        "food_1: its battery hardly lasts; the arena is 2 m wide",
        # The corner is 1.273 m away, less the radii of the station and of the rescue: 0.973 m.
        "food_0: from a victim at [-0.9, -0.9] its full battery brings it back to no station",
        "food_1: from a victim at [-0.9, -0.9] its full battery brings it back to no station",
    ]
    near = made.replace(victim_places_m=((0.5, 0.0), (0.0, 0.5)))  # 0.2 m
    assert not any("back to no station" in line for line in scenario_words(near).splitlines())
    both = near.replace(robots=(made.robots[0], *others))
    assert scenario_words(both).splitlines()[-1] == (
        "stations[0]: gives no more than the 2 W that robots there use"
    )


def test_an_end_when_all_is_done_has_words() -> None:
    arrivals = [Arrival(at_s=at_s, task="task_1", position_m=(0.5, 0.5)) for at_s in (0.0, 2.0)]
    made = Scenario().replace(situation="listed", arrivals=arrivals, end_when_done=True)
    assert scenario_words(made).splitlines()[2:] == [
        "2 victims in all; an episode ends when each was rescued, lost or turned away"
    ]
    late = made.replace(episode_steps=10)
    assert scenario_words(late).splitlines()[3:] == [
        "end_when_done: a victim arrives after 2 s, and time is up at 1 s"
    ]


def test_loads_have_words() -> None:
    robots = [robot.model_dump() for robot in Scenario().robots]
    robots[0]["load"], robots[3]["load"] = 1, 3
    made = Scenario.model_validate({"robots": robots})
    assert scenario_words(made).splitlines()[2:] == [
        "food_0: helps with 1 rescue, then with none: there is no depot",
        "medical_0: helps with 3 rescues, then with none: there is no depot",
    ]
    with_depot = made.replace(depots=[{"position_m": (0.0, 0.0)}])
    assert scenario_words(with_depot).splitlines()[3] == (
        "medical_0: helps with 3 rescues, then it goes to a depot"
    )


def test_layers_have_words() -> None:
    words = scenario_words(Scenario.preset("air-ground")).splitlines()
    assert words[2:] == [
        "layer ground: navigation_0, medical_0; they touch no robot of another layer",
        "layer air: food_0, food_1; they touch no robot of another layer",
        "obstacles[0]: robots of air pass it",
        "obstacles[1]: robots of air pass it",
    ]
    assert "layer" not in scenario_words(Scenario())


def test_set_velocities_have_words_and_need_no_force() -> None:
    first, *others = Scenario().robots
    still = {"drive_force_n": 0.0}
    made = Scenario(robots=(first.replace(**still, drive="velocity"), *others))
    assert scenario_words(made).splitlines()[2:] == ["food_0: actions set the velocity"]
    assert "food_0: cannot move" in scenario_words(
        Scenario(robots=(first.replace(**still), *others))
    )


def test_helpers_of_different_layers_meet_however_large() -> None:
    robots = [robot.replace(radius_m=0.16) for robot in Scenario().robots]
    doubt = "helpers hardly meet"
    assert doubt in scenario_words(Scenario(robots=tuple(robots)))
    flying = [robot.replace(layer="air") for robot in robots[:2]]
    assert doubt not in scenario_words(Scenario(robots=(*flying, *robots[2:])))
    assert doubt not in scenario_words(Scenario(robots=tuple(robots), engine="none"))


@pytest.mark.parametrize(("radius_m", "rare"), [(0.15, True), (0.13, True), (0.12, False)])
def test_helpers_that_touch_where_they_reach_a_victim_hardly_meet(
    radius_m: float, rare: bool
) -> None:
    """Of bodies as large as the reach nobody is ever rescued: two touch with the victim between."""
    robots = [one.replace(radius_m=radius_m) for one in Scenario().robots]
    assert ("task_1: helpers hardly meet" in scenario_words(Scenario(robots=tuple(robots)))) == rare


def test_what_is_doubtful() -> None:
    scenario = Scenario.model_validate(
        {
            "arena_half_width_m": 3.0,
            "rescue_radius_m": 0.28,
            "robots": [
                robot("a", 0.3, "lift"),
                robot("b", 0.3, "lift", force=0.0),
                robot("c", 0.1),
            ],
            "tasks": [{"name": "beam", "needs": ["lift", "lift"]}],
            "faults": [
                {"robot": "a", "kind": "motor_gain", "value": 0.3, "onset_step": 20},
                {"robot": "b", "kind": "heading_bias", "value": 1.5708, "duration_steps": 3},
            ],
        }
    )
    assert scenario_words(scenario).splitlines() == [
        "beam: lift (2 of a, b), together within 0.28 m",
        "b: cannot move, its drive_force_n is 0",
        "c: has no ability that a task needs",
        "beam: helpers hardly meet; without overlap of bodies rescue_radius_m must be above 0.3, "
        "and 0.45 gives them room",
        "victims in a corner: a robot as large as the largest cannot reach them; "
        "wall_clearance_m = 0.3 would do",
        "a: has 30 % of its force from step 20 on",
        "b: drives 90 degrees beside its heading from step 0 on, for 3 steps",
    ]


def test_every_kind_of_fault_has_words() -> None:
    assert set(_WHAT) == set(FAULT_KINDS)


def test_what_no_team_can_do_is_refused_with_the_value_that_would_do() -> None:
    two = {"robots": [robot("a", 0.3, "lift"), robot("b", 0.3, "lift")]}
    task = {"tasks": [{"name": "beam", "needs": ["lift", "lift"]}], "arena_half_width_m": 3.0}
    with pytest.raises((ConfigError, ValueError), match=r"rescue_radius_m = 0\.15: .* 0\.3"):
        Scenario.model_validate({**two, **task, "rescue_radius_m": 0.15})
    Scenario.model_validate({**two, **task, "rescue_radius_m": 0.3})


def test_how_many_arrive() -> None:
    plain = Scenario.preset("mixed")
    tasks = (plain.tasks[0].replace(arrival_rate_hz=0.25), plain.tasks[1])
    arriving = plain.replace(situation="poisson", max_victims=3, tasks=tasks)
    first, second = scenario_words(arriving).splitlines()[:2]
    assert first.endswith("within 0.15 m; 0.25 a second arrive, at most 3 wait at once")
    assert second.endswith("within 0.15 m; 0 a second arrive, at most 3 wait at once")
    assert "arrive" not in scenario_words(plain)
    arrival = Arrival(at_s=1.0, task="task_2", position_m=(0.5, 0.5))
    listed = plain.replace(situation="listed", arrivals=(arrival,))
    first, second = scenario_words(listed).splitlines()[:2]
    assert first.endswith("; 0 arrive, at most 2 wait at once")
    assert second.endswith("; 1 arrive, at most 2 wait at once")


def test_what_a_task_waits_for() -> None:
    plain = Scenario.preset("mixed")
    ordered = plain.replace(tasks=(plain.tasks[0], plain.tasks[1].replace(after=("task_1",))))
    first, second = scenario_words(ordered).splitlines()[:2]
    assert first.startswith("task_1: ")
    assert "after" not in first
    assert second.endswith("within 0.15 m; after task_1")
