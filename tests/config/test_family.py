"""Families of teams: what is drawn lies in the ranges, and can do its tasks."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from innerattn.config import Scenario
from innerattn.config.family import Family
from innerattn.errors import ConfigError

FAMILY = Family()


@given(seed=st.integers(0, 2**31), number=st.integers(0, 1_000))
def test_a_team_lies_in_the_ranges(seed: int, number: int) -> None:
    scenario = FAMILY.draw(seed, number, Scenario(episode_steps=50))
    assert 2 <= scenario.num_robots <= 12
    assert 1 <= len(scenario.tasks) <= 3
    kinds = {robot.kind: robot for robot in scenario.robots}
    for robot in scenario.robots:
        assert 0.5 <= robot.max_speed_mps <= 1.9
        assert 0.4 <= robot.mass_kg <= 1.5
        assert 1 <= len(robot.abilities) <= 3
        like = kinds[robot.kind]
        assert robot.model_copy(update={"name": like.name}) == like
    for task in scenario.tasks:
        assert 1 <= len(task.needs) <= 3
        # Needs of different abilities may meet in one robot; the compiled module checks the rest.
        for need in set(task.needs):
            able = sum(need in robot.abilities for robot in scenario.robots)
            assert able >= task.needs.count(need)
    assert 1 <= scenario.max_victims <= 6
    assert 0.8 <= scenario.arena_half_width_m <= 1.2 + 0.1 * max(0, scenario.num_robots - 4)
    assert scenario.episode_steps == 50
    for fault in scenario.faults:
        assert fault.kind == "unavailable"
        assert fault.onset_step < 50


@given(seed=st.integers(0, 2**31), number=st.integers(0, 1_000))
def test_tasks_take_time_without_changing_the_team(seed: int, number: int) -> None:
    never = Family(service=0.0, deadline=0.0, order=0.0).draw(seed, number)
    always = Family(service=1.0, deadline=1.0, order=1.0, service_s=(1.0, 2.0)).draw(seed, number)
    plain = [{"service_s": 0.0, "service": "keep", "deadline_s": None, "after": ()}] * 3
    timeless = [
        task.model_copy(update=values) for task, values in zip(always.tasks, plain, strict=False)
    ]
    assert always.replace(tasks=[task.model_dump() for task in timeless]) == never
    names = [task.name for task in always.tasks]
    for index, task in enumerate(always.tasks):
        assert 1.0 <= task.service_s <= 2.0
        assert isinstance(task.deadline_s, float)
        assert 2.0 <= round(task.deadline_s - task.service_s, 9) <= 10.0
        assert len(task.after) == (index > 0)
        assert set(task.after) <= set(names[:index])


@given(seed=st.integers(0, 2**31), number=st.integers(0, 1_000))
def test_victims_may_arrive_at_random(seed: int, number: int) -> None:
    family = Family(situations=("poisson",), arrival_rate_hz=(0.5, 0.7), max_victims=(2, 3))
    found = family.draw(seed, number)
    rates = [task.arrival_rate_hz for task in found.tasks]
    assert all(0.5 <= rate <= 0.7 for rate in rates)
    assert found.num_victims == found.max_victims * len(found.tasks)
    # Everything else is as where none arrives.
    tasks = [task.model_dump() | {"arrival_rate_hz": 0.0} for task in found.tasks]
    mixed = Family(situations=("mixed",), max_victims=(2, 3)).draw(seed, number)
    assert found.replace(situation="mixed", tasks=tasks) == mixed


def test_seed_and_number_fix_a_team() -> None:
    assert FAMILY.draw(3, 5) == FAMILY.draw(3, 5)
    teams = [FAMILY.draw(seed, number) for seed in range(3) for number in range(3)]
    assert all(one != other for i, one in enumerate(teams) for other in teams[:i])


def test_shares_are_about_what_is_asked_for() -> None:
    teams = [FAMILY.draw(0, number) for number in range(400)]
    assert sum(bool(team.faults) for team in teams) / 400 == pytest.approx(0.25, abs=0.08)
    assert sum(team.situation == "mixed" for team in teams) / 400 == pytest.approx(0.6, abs=0.08)
    timed = {"service": "has_services", "deadline": "has_deadlines"}
    for share, told in {"service": 0.2, "deadline": 0.1}.items():
        found = sum(getattr(team, timed[share]) for team in teams) / 400
        assert found == pytest.approx(told, abs=0.06)
    several = [team for team in teams if len(team.tasks) > 1]
    found = sum(team.has_order for team in several) / len(several)
    assert found == pytest.approx(0.2, abs=0.08)
    usual = sum(team.arena_half_width_m == 1.0 for team in teams) / 400
    assert usual == pytest.approx(0.4, abs=0.1)


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"robots": (5, 2)}, "family.robots = [5, 2]: the low end must not be above the high end"),
        ({"robots": (5, 65)}, "family.robots = [5, 65]: at most 64"),
        ({"arrival_rate_hz": (2.0, 1.0)}, "family.arrival_rate_hz = [2.0, 1.0]: the low end"),
        ({"needs": ()}, "family.needs = []: must have an entry"),
        ({"unavailable": 1.5}, "less than or equal to 1"),
        ({"robot": (2, 3)}, "robot"),
    ],
)
def test_wrong_values(values: dict[str, object], said: str) -> None:
    with pytest.raises(ValidationError) as error:
        Family(**values)
    assert said in str(error.value)


def test_a_family_without_a_team_says_why() -> None:
    family = Family(max_speed_mps=(500.0, 600.0))
    with pytest.raises(ConfigError, match=r"none of 1000 teams drawn can be used, .*max_speed_mps"):
        family.draw(0, 0)
