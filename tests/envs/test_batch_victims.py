"""`BatchEnv.set_victims`: victims that are moved or added, and what is refused."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from innerattn.config import Scenario
from innerattn.envs import BatchEnv

ENVS = 3


def batch(situation: str = "mixed", **fields: Any) -> BatchEnv:
    scenario = Scenario.preset("mixed").replace(situation=situation, **fields)
    env = BatchEnv(scenario, ENVS, seed=4, num_threads=1)
    env.reset()
    return env


def stay(env: BatchEnv) -> np.ndarray:
    return np.zeros((env.num_envs, env.num_robots), np.int64)


def test_giving_back_what_is_there_changes_nothing() -> None:
    env = batch()
    before = env.snapshot()
    env.set_victims(env.victims())
    assert env.snapshot() == before


@pytest.mark.parametrize("whole", [False, True])
def test_victims_may_be_moved_out_of_their_area(whole: bool) -> None:
    area = (-0.5, -0.5, 0.5, 0.5)
    tasks = [task.replace(area_m=None if whole else area) for task in Scenario().tasks]
    env = batch("double", victim_area_m=area if whole else None, tasks=tasks)
    victims = env.victims()
    assert (abs(victims["x"]) <= 0.5).all()
    victims["x"] = 0.875
    env.set_victims(victims)
    np.testing.assert_array_equal(env.victims(), victims)
    other = batch("double", victim_area_m=area if whole else None, tasks=tasks)
    other.restore(env.snapshot())
    np.testing.assert_array_equal(other.victims(), victims)


def test_a_victim_that_is_added_is_seen_and_rescued() -> None:
    env = batch(max_victims=4)
    victims = env.victims()
    empty = np.argwhere(~victims["present"])
    assert len(empty)
    earlier = victims["id"].max(1)
    for world, slot in empty:
        victims[world, slot] = (True, 0, -7, -7, 0.25, -0.5)
    obs = env.observe()
    env.set_victims(victims)
    found = env.victims()
    for world in range(ENVS):
        slots = empty[empty[:, 0] == world, 1]
        ids = found["id"][world, slots].tolist()
        assert ids == [earlier[world] + 1 + n for n in range(len(slots))], "the next numbers"
        assert (found["appeared_step"][world, slots] == 0).all()
    assert not np.array_equal(env.observe(), obs)
    positions = env.positions()
    for robot, name in enumerate(env.robot_names):  # those who can help stand around the place
        near = 0.06 if name.endswith("0") else 0.3
        positions[:, robot] = (0.25 + near * (1 if "food" in name else -1), -0.5)
    positions[:, env.robot_names.index("navigation_0")] = (0.25, -0.2)
    env.set_motion(positions, np.zeros_like(positions))
    rescues = env.step(stay(env)).rescues
    names = {env.robot_names[rescue["helper_0"]] for rescue in rescues}
    assert set(rescues["env"]) == set(empty[:, 0])
    assert names == {"food_0"}


@settings(max_examples=60)
@given(st.data())
def test_what_is_accepted_is_what_is_there_then(data: st.DataObject) -> None:
    situation = data.draw(st.sampled_from(["single", "double", "mixed"]))
    env = batch(situation)
    numbers = st.floats(-1.25, 1.25, width=32, allow_subnormal=False) | st.sampled_from(
        [np.nan, np.inf, 0.9, -0.9]
    )
    victims, before = env.victims(), env.snapshot()
    there = victims.copy()
    for world, slot in np.ndindex(victims.shape):
        if data.draw(st.booleans()):
            task = slot if situation == "double" else data.draw(st.integers(-1, 2))
            place = data.draw(numbers), data.draw(numbers)
            victims[world, slot] = (data.draw(st.integers(0, 4)) > 0, task, 0, 0, *place)
    tasks = np.arange(victims.shape[1]) if situation == "double" else None
    right = (victims["task"] == tasks) if tasks is not None else np.isin(victims["task"], (0, 1))
    reach = np.float32(1.0) - np.float32(0.1)
    right &= (np.abs(victims["x"]) <= reach) & (np.abs(victims["y"]) <= reach)
    allowed = np.where(victims["present"], right, ~there["present"]).all()
    if not allowed:
        with pytest.raises(ValueError, match=r"^victims\[\w+, env \d, slot \d\] = .*: must be "):
            env.set_victims(victims)
        assert env.snapshot() == before
        return
    env.set_victims(victims)
    found, present = env.victims(), victims["present"]
    assert np.array_equal(found["present"], present)
    for field in ("task", "x", "y"):
        assert np.array_equal(found[field][present], victims[field][present])
    kept = present & there["present"]
    assert np.array_equal(found["id"][kept], there["id"][kept])
    restored = batch(situation)
    restored.restore(env.snapshot())  # a state that the scenario allows
    env.step(stay(env))


def test_refusals_name_what_is_wrong_and_change_nothing() -> None:
    env = batch()
    good, before = env.victims(), env.snapshot()

    def changed(field: str, value: object, slot: int = 0) -> np.ndarray:
        victims = good.copy()
        victims["x"] = -victims["x"]  # would move everyone
        victims[field][2, slot] = value
        return victims

    assert good["present"][:, 0].all()
    wide = [(name, "f8") for name in good.dtype.names or ()]
    for error, message, victims in [
        (ValueError, r"victims\[task, env 2, slot 0\] = 2: must be in 0\.\.=1", changed("task", 2)),
        (ValueError, r"victims\[task, env 2, slot 0\] = -1: must be in", changed("task", -1)),
        (ValueError, r"victims\[x, env 2, slot 0\] = 0.91: must be in", changed("x", 0.91)),
        (ValueError, r"victims\[y, env 2, slot 0\] = NaN: must be in", changed("y", np.nan)),
        (ValueError, r"victims\[present, env 2, slot 0\] = false", changed("present", False)),
        (ValueError, r"victims has shape \(2, 2\): must have shape \(3, 2\)", good[:2]),
        (TypeError, "victims is a masked array", np.ma.array(good)),
        (TypeError, "victims has dtype float64", np.zeros((3, 2))),
        (TypeError, "victims is no array", good.tolist()),
        (TypeError, r"victims\['present'\] has dtype float64", good.astype(wide)),
    ]:
        with pytest.raises(error, match=message):
            env.set_victims(victims)
        assert env.snapshot() == before, message
