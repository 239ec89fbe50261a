"""Schedules of instances beside plain Python code that plays and makes them."""

import math
import signal
import time
from collections.abc import Sequence
from random import Random

import pytest
from drawn_instances import instances
from hypothesis import given, settings
from hypothesis import strategies as st
from played_schedule import can_do, made_greedily, played

from innerattn.config.instances import Instance, read_instances
from innerattn.errors import ScheduleError
from innerattn.policies.scripted.planner import PLANNERS, plan, schedule_by, simulate

RAL = read_instances("ral")


def check_played(instance: Instance, tasks: Sequence[Sequence[int]]) -> None:
    """Compare the compiled simulation with the plain one, to the last bit."""
    found, plain = simulate(instance, tasks), played(instance, tasks)
    assert plain is not None
    assert (list(found.starts), list(found.returns)) == plain
    assert found.makespan == max(plain[1])


@given(instances(), st.integers(0, 99))
def test_schedules_are_played_as_by_plain_code(instance: Instance, seed: int) -> None:
    for name in ("greedy", "random"):
        check_played(instance, schedule_by(name, instance, 0.0, seed).tasks)
    check_played(instance, plan(instance, None, 50, seed).tasks)


@given(instances(tasks=5), st.randoms(use_true_random=False), st.integers(0, 99))
def test_a_deadlock_is_found_where_plain_code_finds_one(
    instance: Instance, random: Random, seed: int
) -> None:
    """Each robot does its tasks in an order of its own."""
    tasks = [list(row) for row in schedule_by("random", instance, 0.0, seed).tasks]
    for row in tasks:
        random.shuffle(row)
    if played(instance, tasks) is None:
        with pytest.raises(ScheduleError, match="drawn: schedule: deadlock: robot"):
            simulate(instance, tasks)
    else:
        check_played(instance, tasks)


def test_robots_that_wait_for_each_other_are_a_deadlock() -> None:
    instance = Instance.model_validate(
        {
            "name": "cross",
            "speed": 1.0,
            "robots": [{"depot": (x, 0.0), "skills": [0]} for x in (0.0, 3.0)],
            "tasks": [
                {"position": (x, 0.0), "skills": [0, 0], "duration": 1.0} for x in (1.0, 2.0)
            ],
        }
    )
    assert played(instance, [[0, 1], [1, 0]]) is None
    with pytest.raises(ScheduleError, match="robot 0 waits at task 0, robot 1 waits at task 1"):
        simulate(instance, [[0, 1], [1, 0]])
    for tasks, told in (
        ([[0, 1], [0]], r"robots \[0\] go to task 1: must fill its needs \[0, 0\]"),
        ([[0, 5], [0]], "robot 0 goes to task 5: must be 0 to 1"),
        ([[0, -1], [0]], "cross: "),
        ([[0]], "has 1 robots: must have 2"),
    ):
        with pytest.raises(ScheduleError, match=told):
            simulate(instance, tasks)


@settings(max_examples=40)
@given(instances(robots=5, tasks=4))
def test_greedy_is_what_plain_code_makes(instance: Instance) -> None:
    found = schedule_by("greedy", instance, 0.0, 0)
    assert [list(row) for row in found.tasks] == made_greedily(instance)


@pytest.mark.parametrize("name", PLANNERS)
def test_no_schedule_of_a_published_instance_beats_its_bound(name: str) -> None:
    for instance in RAL:
        found = schedule_by(name, instance, 0.005, 3)
        assert instance.lower_bound_milp is not None
        assert found.makespan >= instance.lower_bound_milp
        check_played(instance, found.tasks)
        for task in range(len(instance.tasks)):
            there = [robot for robot, row in enumerate(found.tasks) if task in row]
            assert can_do(instance, task, there)


def test_the_planner_beats_the_program_of_the_authors() -> None:
    found = [plan(instance, None, 15_000).makespan for instance in RAL]
    published = [instance.makespan_milp_600s or math.nan for instance in RAL]
    assert sum(found) / sum(published) < 0.955
    greedy = [schedule_by("greedy", instance, 0.0, 0).makespan for instance in RAL]
    assert all(ours <= theirs for ours, theirs in zip(found, greedy, strict=True))


def test_the_learnt_policy_is_shorter_than_published_and_helps_a_short_search() -> None:
    def mean(name: str, evaluations: int) -> float:
        found = (schedule_by(name, one, None, 0, evaluations) for one in RAL)
        return sum(one.makespan for one in found) / len(RAL)

    published = sum(instance.makespan_milp_600s or math.nan for instance in RAL) / len(RAL)
    assert mean("learnt", 1) < 0.995 * published
    assert mean("guided", 1_000) < mean("planner", 1_000)


def test_a_number_of_evaluations_gives_the_same_bits_everywhere() -> None:
    found = [plan(instance, None, 2_000, seed=7).makespan.hex() for instance in RAL[:4]]
    assert found == [
        "0x1.a5ea3af6dc881p+4",
        "0x1.6feb030eb4cf0p+4",
        "0x1.6c40cbd700451p+4",
        "0x1.80126bad05b38p+4",
    ]


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="only POSIX has this timer")
def test_a_search_can_be_interrupted() -> None:
    def ring(*_: object) -> None:
        raise TimeoutError("it rang")

    before = signal.signal(signal.SIGALRM, ring)
    signal.setitimer(signal.ITIMER_REAL, 0.3)
    began = time.monotonic()
    try:
        with pytest.raises(TimeoutError, match="it rang"):
            plan(RAL[0], 200.0)
    finally:
        signal.signal(signal.SIGALRM, before)
    assert time.monotonic() - began < 60.0


def test_limits_are_checked() -> None:
    with pytest.raises(ValueError, match=r"seconds = -1\.0: must be 0\.0 to 1e6"):
        plan(RAL[0], -1.0)
    with pytest.raises(ValueError, match="seconds = none: must be given"):
        plan(RAL[0], None)
