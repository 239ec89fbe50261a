"""What a batch refuses: in one line, and without a change of its state."""

import re

import numpy as np
import pytest
from worlds import CONTINUOUS, CROWDED, batch, image, plan

from innerattn.config import Scenario
from innerattn.envs import BatchEnv


def discrete(value: object, dtype: type = np.int64) -> np.ndarray:
    actions = np.ones((3, 4), dtype)
    actions[1, 2] = value
    return actions


def continuous(value: float, dtype: type = np.float32) -> np.ndarray:
    actions = np.zeros((3, 4, 2), dtype)
    actions[1, 2, 1] = value
    return actions


AT = r"^actions\[env 1, robot 2\]"


@pytest.mark.parametrize(
    ("scenario", "actions", "error", "message"),
    [
        (CROWDED, discrete(5), ValueError, AT + " = 5: .*0.*4"),
        (CROWDED, discrete(-1), ValueError, AT + " = -1: "),
        (CROWDED, discrete(2**63 - 1), ValueError, AT),
        (CROWDED, discrete(2**64 - 1, np.uint64), ValueError, AT),
        (CROWDED, discrete(200, np.uint8), ValueError, AT + " = 200: "),
        (CROWDED, discrete(1, np.float32), TypeError, "dtype float32: must be integers"),
        (CROWDED, discrete(1, bool), TypeError, "dtype bool: must be integers"),
        (CROWDED, discrete(1, object), TypeError, "dtype object"),
        (CROWDED, np.ones((3, 5), int), ValueError, r"shape .*3, 5.*must be \(3, 4\)"),
        (CROWDED, np.ones((4, 3), int), ValueError, r"must be \(3, 4\)"),
        (CROWDED, np.ones(12, int), ValueError, r"must be \(3, 4\)"),
        (CROWDED, np.ones((3, 4, 2), int), ValueError, r"must be \(3, 4\)"),
        (CONTINUOUS, continuous(np.nan), ValueError, AT + ".*NaN"),
        (CONTINUOUS, continuous(np.inf), ValueError, AT),
        (CONTINUOUS, continuous(1.001), ValueError, AT + ".*1.001"),
        (CONTINUOUS, continuous(-1.001), ValueError, AT),
        (CONTINUOUS, continuous(1e300, np.float64), ValueError, AT),
        (CONTINUOUS, continuous(0, np.int64), TypeError, "dtype int64: must be floats"),
        (CONTINUOUS, continuous(0, np.complex64), TypeError, "dtype complex64"),
        (CONTINUOUS, np.zeros((3, 4), np.float32), ValueError, r"must be \(3, 4, 2\)"),
        (CONTINUOUS, np.zeros((3, 4, 3), np.float32), ValueError, r"must be \(3, 4, 2\)"),
    ],
)
@pytest.mark.filterwarnings("ignore:overflow encountered in cast")
def test_bad_actions_move_nothing(
    scenario: Scenario, actions: np.ndarray, error: type[Exception], message: str
) -> None:
    env = batch(3, scenario)
    before, obs = env.snapshot(), env.observe()
    held = obs.copy()
    with pytest.raises(error, match=message) as caught:
        env.step(actions)
    assert "\n" not in str(caught.value)
    assert env.snapshot() == before
    assert (obs == held).all()


@pytest.mark.parametrize("dtype", [np.int8, np.uint8, np.int32, np.uint64, ">i8", "list"])
def test_every_integer_dtype_is_understood(dtype: str | type) -> None:
    actions = plan(1, 3)[0]
    env, other = batch(3), batch(3)
    given = actions.tolist() if dtype == "list" else actions.astype(dtype)
    assert image(env.step(given), env) == image(other.step(actions), other)


@pytest.mark.parametrize("dtype", [np.float16, np.float32, np.float64])
def test_every_float_dtype_is_understood(dtype: type) -> None:
    actions = np.random.default_rng(0).uniform(-1, 1, (3, 4, 2)).astype(np.float16)
    env, other = batch(3, CONTINUOUS), batch(3, CONTINUOUS)
    wanted = image(other.step(actions.astype(np.float32)), other)
    assert image(env.step(actions.astype(dtype)), env) == wanted


def test_strided_actions_are_understood() -> None:
    env, other = batch(3), batch(3)
    wide = plan(1, 6)[0]
    turned = np.asfortranarray(wide[::2])
    wanted = image(other.step(np.ascontiguousarray(wide[::2])), other)
    assert image(env.step(wide[::2]), env) == wanted
    env = batch(3)
    assert image(env.step(turned), env) == wanted


TEAM = Scenario().model_dump(mode="json")["robots"]


def scenario_with(**fields: object) -> dict:
    return {"robots": TEAM} | fields


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        (
            {"robots": [{**TEAM[0], "name": f"r{i}"} for i in range(62)] + TEAM[1:]},
            "scenario.robots (their number) = 65: must be in 1..=64",
        ),
        (
            {"robots": [*TEAM[:2], {**TEAM[2], "mass_kg": -1}, TEAM[3]]},
            "scenario.robots[2].mass_kg = -1: must be in 0.01..=1000 kg",
        ),
        (
            {"robots": [*TEAM[:2], {**TEAM[2], "mass_kg": 0.05}, TEAM[3]]},
            'scenario.robots (heaviest to lightest mass_kg) = 20: "food_0" weighs 1 kg and '
            '"navigation_0" 0.05 kg; must be at most 16 with engine = "rapier", and 100 with '
            '"discs"',
        ),
        ({"robots": []}, "scenario.robots (their number) = 0: must be in 1..=64"),
        (
            {"robots": TEAM[:3]},
            "scenario.tasks[0].needs: task 'task_1' needs 'medicine', which no robot of the team "
            "can do; abilities of the team are food, information",
        ),
        (
            {"tasks": [{"name": "three", "needs": ["food", "food", "food"]}]},
            "scenario.tasks[0].needs = food + food + food: "
            "the team has no distinct able robot for each need",
        ),
        ({"max_victims": 33}, "scenario.max_victims = 33: must be in 1..=32"),
        ({"max_victims": 0}, "scenario.max_victims = 0: must be in 1..=32"),
        ({"spawn_clearance_m": 11}, "scenario.spawn_clearance_m = 11: must be in 0..=10 m"),
        (
            {"spawn_clearance_m": 2.5},
            "scenario.spawn_clearance_m = 2.5: no place is so far from all robots",
        ),
        ({"dt_s": 0}, "scenario.dt_s = 0: must be in 0.001..=1 s"),
    ],
)
def test_bad_scenarios_are_refused_in_one_line(fields: dict, message: str) -> None:
    with pytest.raises(ValueError, match=re.escape(message)) as caught:
        BatchEnv(Scenario.model_validate(scenario_with(**fields)), 1)
    lines = [line for line in str(caught.value).splitlines() if "scenario." in line]
    assert len(lines) == 1


def test_unknown_keys_are_named() -> None:
    with pytest.raises(ValueError, match="colour"):
        Scenario(colour="red")


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"num_envs": 0}, ValueError, "num_envs = 0: must be in 1..=1048576"),
        ({"num_envs": -3}, ValueError, "num_envs = -3: must be in 1..=1048576"),
        ({"num_envs": 2**20 + 1}, ValueError, "num_envs = 1048577: must be in 1..=1048576"),
        ({"num_envs": 1.0}, TypeError, "num_envs = 1.0: must be an integer in 1..=1048576"),
        ({"num_envs": True}, TypeError, "num_envs = True: must be an integer"),
        ({"scenario": {}}, TypeError, "scenario = {}: must be a Scenario or the name of a preset"),
        ({"seed": -1}, ValueError, f"seed = -1: must be in 0..={2**64 - 1}"),
        ({"seed": 2**64}, ValueError, f"seed = {2**64}: must be in 0..="),
        ({"num_threads": 0}, ValueError, "num_threads = 0: must be in 1..=256"),
        ({"num_threads": 257}, ValueError, "num_threads = 257: must be in 1..=256"),
        ({"first_env": -1}, ValueError, "first_env = -1: must be in 0..="),
        ({"autoreset": "NextStep"}, ValueError, "autoreset = 'NextStep': must be"),
        ({"copy": "no"}, TypeError, "copy = 'no': must be True or False"),
    ],
)
def test_bad_options_are_refused(options: dict, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=re.escape(message)):
        BatchEnv(**{"scenario": "mixed", "num_envs": 1} | options)


def test_bad_resets_and_motions_change_nothing() -> None:
    env = batch(3)
    before = env.snapshot()
    places = env.positions()
    spoilt = places.copy()
    spoilt[2, 1, 0] = np.nan
    outside = places.copy()
    outside[2, 1, 0] = -0.61
    for error, message, attempt in [
        (TypeError, "mask has dtype int64", lambda: env.reset(mask=[1, 0, 1])),
        (ValueError, "mask has shape", lambda: env.reset(mask=[[True, False, True]])),
        (ValueError, "mask has shape", lambda: env.reset(mask=[True, False])),
        (ValueError, "seed = -1", lambda: env.reset(seed=-1)),
        (TypeError, "seed = 0.5", lambda: env.reset(seed=0.5)),
        (ValueError, "positions", lambda: env.set_motion(spoilt, places)),
        (
            ValueError,
            r"positions = -0.61 \(env 2, robot 1\): must be in -0.6\.\.=0.6 m",
            lambda: env.set_motion(outside, places),
        ),
        (ValueError, "velocities", lambda: env.set_motion(places, spoilt)),
        (
            ValueError,
            r"velocities = 10001 \(env 0, robot 0\): must be in -10000\.\.=10000 m/s",
            lambda: env.set_motion(places, np.full_like(places, 10001.0)),
        ),
        (ValueError, r"positions has shape .*must be", lambda: env.set_motion(places[:2], places)),
        (ValueError, r"positions has shape \(4, 2\)", lambda: env.set_motion(places[0], places)),
    ]:
        with pytest.raises(error, match=message):
            attempt()
        assert env.snapshot() == before, message


def test_a_closed_environment_says_so() -> None:
    with batch(2) as env:
        env.step(plan(1, 2)[0])
    env.close()
    for attempt in (
        env.reset,
        env.observe,
        env.positions,
        env.victims,
        env.snapshot,
        env.observation_names,
        lambda: env.step(plan(1, 2)[0]),
        lambda: env.restore(b""),
    ):
        with pytest.raises(RuntimeError, match="closed"):
            attempt()
