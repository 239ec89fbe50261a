"""Rows from readings are those of the worlds, and bad readings are refused by name."""

from collections.abc import Callable
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_export import made_export, readings_of

from innerattn.config import Scenario
from innerattn.envs import BatchEnv
from innerattn.errors import ReadingError, StaleReadingError
from innerattn.policies import Exported

BOTH = pytest.mark.parametrize("name", ["plain_export", "framed_export"])
ROBOTS = ("food_0", "food_1", "navigation_0", "medical_0")


@pytest.fixture
def team(request: pytest.FixtureRequest, name: str) -> Exported:
    return Exported(request.getfixturevalue(name), backend="numpy")


def worlds(team: Exported, count: int, seed: int, **changes: object) -> BatchEnv:
    scenario = Scenario.model_validate(team.contract.scenario | changes)
    env = BatchEnv(scenario, count, seed=seed, num_threads=1)
    env.reset()
    return env


def played(env: BatchEnv, steps: int, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    for _ in range(steps):
        env.step(rng.integers(0, 5, (env.num_envs, env.num_robots)))
    return env.observe()


exported = cache(partial(Exported, backend="numpy"))


@pytest.mark.long
@BOTH
@settings(max_examples=10)
@given(seed=st.integers(0, 2**32), steps=st.integers(0, 30))
def test_rows_are_those_of_the_worlds_to_the_bit(
    request: pytest.FixtureRequest, name: str, seed: int, steps: int
) -> None:
    team = exported(request.getfixturevalue(name))
    env = worlds(team, 4, seed, max_victims=2)
    obs = played(env, steps, seed)
    for world in range(4):
        for index, robot in enumerate(ROBOTS):
            row = team.row(robot, readings_of(team, robot, env, world))
            assert row.dtype == np.float32
            np.testing.assert_array_equal(row, obs[world, index])


TIMES = {"service_s": 0.9, "deadline_s": (1.0, 3.0)}
TASKS = [
    {"name": "task_1", "needs": {"food": 3.1, "medicine": 0.3}, "arrival_rate_hz": 2.0, **TIMES},
    {
        "name": "task_2",
        "needs": ("food", "information"),
        "arrival_rate_hz": 2.0,
        "after": ("task_1",),
    },
]


@pytest.mark.long
def test_rows_of_worlds_with_amounts_times_order_and_arrivals(tmp_path: Path) -> None:
    robots = [robot.model_dump() for robot in Scenario().robots]
    robots[1]["abilities"], robots[3]["abilities"] = {"food": 2.5}, {"medicine": 0.3, "food": 0.2}
    changes = {
        "scenario.tasks": TASKS,
        "scenario.robots": robots,
        "scenario.rescue_radius_m": 1.0,
        "scenario.situation": "poisson",
    }
    team = Exported(made_export(tmp_path, "td-inner", **changes)[1], backend="numpy")
    env = worlds(team, 16, 1)
    obs = played(env, 6, 0)
    assert 0 < env.victims()["present"].sum() < env.victims().size
    assert env.victims()["served"].any()
    assert env.victims()["blocked"].any()
    for world in range(16):
        for index, robot in enumerate(ROBOTS):
            row = team.row(robot, readings_of(team, robot, env, world))
            np.testing.assert_array_equal(row, obs[world, index])
    readings: dict[str, Any] = readings_of(team, "food_0", env, 0)
    for wrong in (-0.1, 1.1, "half"):
        readings["victims"][0]["served"] = wrong
        with pytest.raises(ReadingError, match=r"victims\.0\.served: is .*: must be"):
            team.row("food_0", readings)
    del readings["victims"][0]["served"]
    with pytest.raises(ReadingError, match=r"victims\.0\.served: is missing"):
        team.row("food_0", readings)


@BOTH
def test_victims_are_there_in_some_worlds_and_not_in_others(team: Exported) -> None:
    """The test above meets full and empty slots, and victims that a robot cannot help."""
    env = worlds(team, 64, 0)
    present = env.victims()["present"].sum(axis=1)
    assert set(present) == {1, 2}
    assert set(env.victims()["task"].ravel()[env.victims()["present"].ravel()]) == {0, 1}


def faulty(env: BatchEnv, robot: int, **levels: float) -> np.ndarray:
    """Observations of worlds in which one robot has faults."""
    faults = env.fault_state()
    for kind, value in levels.items():
        faults[kind][:, robot] = value
    env.set_faults(faults)
    return env.observe()


@BOTH
def test_a_robot_that_hears_nobody_sees_what_lost_communication_leaves(team: Exported) -> None:
    env = worlds(team, 8, 3)
    played(env, 7, 0)
    obs = faulty(env, 1, lost_communication=1.0)
    for world in range(8):
        readings = readings_of(team, "food_1", env, world)
        _tell_faults(team, readings["own"], lost_communication=1.0)
        for silent in ({}, dict.fromkeys(("food_0", "navigation_0", "medical_0"))):
            row = team.row("food_1", {**readings, "teammates": silent})
            np.testing.assert_array_equal(row, obs[world, 1])
        assert not np.array_equal(team.row("food_1", readings), obs[world, 1])


@BOTH
def test_a_dropped_message_leaves_zeros_in_that_teammates_columns_alone(team: Exported) -> None:
    env = worlds(team, 1, 3)
    obs = played(env, 5, 0)
    readings = readings_of(team, "food_1", env, 0)
    del readings["teammates"]["navigation_0"]  # type: ignore[attr-defined]
    row = team.row("food_1", readings)
    names = [column.name for column in team.contract.observation]
    silent = [name.startswith("teammate_1.") for name in names]
    assert sum(silent) == (len(names) - 12) // 4
    assert not row[silent].any()
    np.testing.assert_array_equal(row[~np.array(silent)], obs[0, 1][~np.array(silent)])


@BOTH
def test_messages_too_old_are_not_heard(team: Exported) -> None:
    env = worlds(team, 1, 3)
    played(env, 5, 0)
    readings: dict[str, Any] = readings_of(team, "food_1", env, 0)
    for one in (readings["own"], *readings["teammates"].values()):
        one["time"] = 10.0
    timed = {**readings, "now": 10.05, "victims_time": 10.0}
    np.testing.assert_array_equal(team.row("food_1", timed), team.row("food_1", readings))
    late = team.contract.max_age_s + 0.01
    for time in (10.05 - late, 10.05 + late):
        readings["teammates"]["medical_0"]["time"] = time
        found = team.row("food_1", timed)
        without = {**timed, "teammates": {**timed["teammates"], "medical_0": None}}
        np.testing.assert_array_equal(found, team.row("food_1", without))
        assert not np.array_equal(found, team.row("food_1", readings))


@BOTH
def test_unavailable_robots_say_so(team: Exported) -> None:
    env = worlds(team, 4, 3)
    obs = faulty(env, 0, unavailable=1.0)
    for world in range(4):
        own = readings_of(team, "food_0", env, world)
        own["own"]["available"] = False  # type: ignore[index]
        np.testing.assert_array_equal(team.row("food_0", own), obs[world, 0])
        other = readings_of(team, "medical_0", env, world)
        other["teammates"]["food_0"]["available"] = np.bool_(False)  # type: ignore[index]
        np.testing.assert_array_equal(team.row("medical_0", other), obs[world, 3])


@BOTH
def test_a_blackout_is_the_dark_row(team: Exported) -> None:
    env = worlds(team, 2, 3)
    obs = faulty(env, 2, blackout=1.0, unavailable=1.0)
    faults = {"blackout": 1.0} if team.contract.observe_faults else {}
    row = team.dark_row("navigation_0", available=False, faults=faults)
    np.testing.assert_array_equal(np.stack([row, row]), obs[:, 2])


@BOTH
def test_frozen_sensors_are_the_row_of_the_step_before(team: Exported) -> None:
    env = worlds(team, 1, 3)
    played(env, 4, 0)
    obs = faulty(env, 0, frozen_sensor=1.0)
    held = readings_of(team, "food_0", env, 0)
    _tell_faults(team, held["own"], frozen_sensor=1.0)
    row = team.row("food_0", held)
    np.testing.assert_array_equal(row, obs[0, 0])
    later = played(env, 6, 1)
    np.testing.assert_array_equal(row, later[0, 0])
    assert not np.array_equal(team.row("food_0", readings_of(team, "food_0", env, 0)), later[0, 0])


@BOTH
def test_an_error_of_the_own_pose_moves_everything_relative(team: Exported) -> None:
    env = worlds(team, 6, 3)
    obs = faulty(env, 3, position_noise=0.05, velocity_noise=0.1)
    for world in range(6):
        readings: dict[str, Any] = readings_of(team, "medical_0", env, world)
        _tell_faults(team, readings["own"], position_noise=0.05, velocity_noise=0.1)
        readings["own"].update(position=obs[world, 3, :2], velocity=obs[world, 3, 2:4])
        np.testing.assert_array_equal(team.row("medical_0", readings), obs[world, 3])


@pytest.mark.parametrize("name", ["framed_export"])
def test_faults_that_are_seen_are_told(team: Exported) -> None:
    env = worlds(team, 2, 3)
    obs = faulty(env, 0, motor_gain=0.5, heading_bias=-1.0)
    told = {"motor_gain": 0.5, "heading_bias": -1.0}
    for world in range(2):
        readings: dict[str, Any] = readings_of(team, "food_1", env, world)
        readings["teammates"]["food_0"]["faults"] = told
        np.testing.assert_array_equal(team.row("food_1", readings), obs[world, 1])


def _tell_faults(team: Exported, own: Any, **levels: float) -> None:
    if team.contract.observe_faults:
        own["faults"] = levels


BODY = {"position": (0.1, 0.2), "velocity": (0.0, 0.0)}
NAN, INF = float("nan"), float("inf")


def good() -> dict[str, Any]:
    return {
        "own": dict(BODY),
        "teammates": {name: dict(BODY) for name in ROBOTS[1:]},
        "victims": [{"task": "task_1", "position": (0.5, 0.5)}],
    }


def put(*path: Any) -> Callable[[dict[str, Any]], None]:
    """Sets what the path leads to."""

    def change(readings: Any) -> None:
        *parts, last, value = path
        for part in parts:
            readings = readings[part]
        readings[last] = value

    return change


def drop(*path: Any) -> Callable[[dict[str, Any]], None]:
    def change(readings: Any) -> None:
        *parts, last = path
        for part in parts:
            readings = readings[part]
        del readings[last]

    return change


WRONG = [
    (drop("own"), "own"),
    (drop("teammates"), "teammates"),
    (drop("victims"), "victims"),
    (put("own", 3), "own"),
    (put("pose", 3), "pose"),
    (put("own", "positon", (0, 0)), "own.positon"),
    (drop("own", "position"), "own.position"),
    (drop("own", "velocity"), "own.velocity"),
    (put("own", "position", (1.0,)), "own.position"),
    (put("own", "position", "ab"), "own.position.x"),
    (put("own", "position", 3.0), "own.position"),
    (put("own", "position", (10**400, 0.0)), "own.position.x"),
    (put("own", "position", (0.0, -(10**5000))), "own.position.y"),
    (put("own", "position", 10**5000), "own.position"),
    (put("own", "velocity", (10**5000, 10**5000)), "own.velocity.x"),
    (put("own", "available", 10**5000), "own.available"),
    (put("now", 10**400), "now"),
    (put("own", "position", (0.0, NAN)), "own.position.y"),
    (put("own", "position", (INF, 0.0)), "own.position.x"),
    (put("own", "position", (500.0, 0.0)), "own.position.x"),
    (put("own", "position", (True, 0.0)), "own.position.x"),
    (put("own", "velocity", np.array([np.nan, 0.0])), "own.velocity.x"),
    (put("own", "velocity", (0.0, 1e300)), "own.velocity.y"),
    (put("own", "available", 1), "own.available"),
    (put("own", "faults", {"motor_gain": 0.5}), "own.faults.motor_gain"),
    (put("teammates", []), "teammates"),
    (put("teammates", "food_9", BODY), "teammates.food_9"),
    (put("teammates", "food_0", BODY), "teammates.food_0"),
    (put("teammates", "food_1", "position", (0.0, NAN)), "teammates.food_1.position.y"),
    (drop("teammates", "medical_0", "velocity"), "teammates.medical_0.velocity"),
    (put("victims", {}), "victims"),
    (put("victims", "task_1"), "victims"),
    (put("victims", [None] * 3), "victims"),
    (put("victims", 0, "task", "task_9"), "victims.0.task"),
    (put("victims", 0, "task", ["task_1"]), "victims.0.task"),
    (put("victims", 0, "task", {"task_1": 1}), "victims.0.task"),
    (put("victims", 0, "task", np.array(["task_1", "task_2"])), "victims.0.task"),
    (put("victims", 0, "task", 10**5000), "victims.0.task"),
    (put("victims", 0, "position", (NAN, 0.0)), "victims.0.position.x"),
    (drop("victims", 0, "position"), "victims.0.position"),
    (put("now", NAN), "now"),
    (put("now", 1.0), "own.time"),
]


@pytest.mark.parametrize(("change", "field"), WRONG)
def test_wrong_readings_are_refused_by_name(
    plain_export: Path, change: Callable[[dict[str, Any]], None], field: str
) -> None:
    team, readings = Exported(plain_export, backend="numpy"), good()
    team.decide("food_0", readings)
    change(readings)
    with pytest.raises(ReadingError) as caught:
        team.decide("food_0", readings)
    assert caught.value.field == field
    assert str(caught.value).startswith(f"{field}: ")
    assert "\n" not in str(caught.value)


def test_stale_readings_are_refused_by_name(plain_export: Path) -> None:
    team = Exported(plain_export, backend="numpy", max_age_s=0.5)
    readings = good()
    readings["teammates"] = {}
    timed = {**readings, "own": {**BODY, "time": 1.0}, "now": 1.4, "victims_time": 1.2}
    team.decide("food_0", timed)
    late = {**timed, "victims_time": 0.0}
    for now, when in ((1.6, "0.600 s before now"), (0.4, "0.600 s after now")):
        with pytest.raises(StaleReadingError) as caught:
            team.decide("food_0", {**timed, "now": now})
        assert str(caught.value) == f"own.time: is {when}: must be at most 0.5 s away"
        assert caught.value.field == "own.time"
    with pytest.raises(StaleReadingError) as caught:
        team.decide("food_0", late)
    assert caught.value.field == "victims_time"
    with pytest.raises(ReadingError) as missing:
        team.decide("food_0", {**timed, "teammates": {"food_1": BODY}})
    assert missing.value.field == "teammates.food_1.time"


def test_wrong_rows_are_refused_by_name(plain_export: Path) -> None:
    team = Exported(plain_export, backend="numpy")
    row = team.row("food_0", good())
    assert team.decide("food_0", row.astype(np.float64)).action == team.decide("food_0", row).action
    wrong = row.copy()
    wrong[7] = np.nan
    cases = [
        (row[1:], "row"),
        (row.astype(str), "row"),
        (wrong, f"row.{team.contract.observation[7].name}"),
        (row.astype(np.float64) + 1e300, f"row.{team.contract.observation[0].name}"),
    ]
    for bad, field in cases:
        with pytest.raises(ReadingError) as caught:
            team.decide("food_0", bad)
        assert caught.value.field == field
    with pytest.raises(ReadingError, match="robot: is 'nobody'"):
        team.decide("nobody", row)
