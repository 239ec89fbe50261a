"""Limited sight as Python sees it: arrays, bounds, views, frames, words, and what is refused."""

from typing import Any

import numpy as np
import pytest
from framed_rows import check_frames_keep

from innerattn.config import Fault, Obstacle, Scenario
from innerattn.config.refusals import refuse_stores_drives_and_senses
from innerattn.envs import BatchEnv, parallel_env
from innerattn.envs.bounds import observation_bounds
from innerattn.errors import ConfigError
from innerattn.report.scenario_words import scenario_words

ENVS = 4
FAN = Scenario().robots[0].replace(drive="unicycle", field_of_view_deg=120.0)
DISC = Obstacle(shape="disc", radius_m=0.2, position_m=(0.0, 0.0))


def sighted(scenario: Scenario | None = None, *limits: float | None, **values: Any) -> Scenario:
    """A scenario whose robots see so far."""
    scenario = scenario or Scenario()
    limits = limits or (0.6,) * scenario.num_robots
    robots = tuple(
        robot.replace(sight_m=limit) for robot, limit in zip(scenario.robots, limits, strict=True)
    )
    return scenario.replace(robots=robots, **values)


def walked(scenario: Scenario, steps: int = 40, **options: Any) -> tuple[BatchEnv, np.ndarray]:
    """Worlds after some random steps, and all observations on the way."""
    env = BatchEnv(scenario, ENVS, seed=3, num_threads=1, **options)
    rng, rows = np.random.default_rng(0), [env.reset()]
    for _ in range(steps):
        rows.append(env.step(rng.integers(0, 5, (ENVS, scenario.num_robots))).obs)
    return env, np.stack(rows)


def test_rows_say_what_the_steps_of_the_last_sights_say() -> None:
    env, rows = walked(sighted(None, 0.3, 0.6, None, 1.0))
    names = env.observation_names()
    seen = [name.endswith(".seen") for name in names]
    last, steps = env.last_seen(), env.step_counts()
    others = [[other for other in range(4) if other != own] for own in range(4)]
    now = np.take_along_axis(last, np.array(others)[None], 2) == steps[:, None, None]
    np.testing.assert_array_equal(rows[-1][..., seen], now)
    assert (last[:, range(4), range(4)] == -1).all()
    assert now[:, 2].all()
    assert not now[:, 0].all()
    assert now.any()
    present = [name.endswith(".present") for name in names]
    in_sight = (last[:, :, 4:] == steps[:, None, None]).sum(-1)
    np.testing.assert_array_equal(rows[-1][..., present].sum(-1), in_sight)


def test_where_no_sight_is_limited_all_is_seen_now() -> None:
    env, _ = walked(Scenario())
    assert not any("seen" in name for name in env.observation_names())
    last = env.last_seen()
    assert last.shape == (ENVS, 4, 6)
    assert (last == env.step_counts()[:, None, None]).all()


@pytest.mark.parametrize("autoreset", ["same_step", "next_step"])
def test_a_new_episode_has_seen_nothing_before(autoreset: Any) -> None:
    env, _ = walked(sighted(episode_steps=10), 23, autoreset=autoreset)
    last, steps = env.last_seen(), env.step_counts()
    assert (last <= steps[:, None, None]).all()
    assert (steps < 10).all()
    copy = BatchEnv(env.scenario, ENVS, num_threads=2)
    if autoreset == "same_step":
        copy.restore(env.snapshot())
        np.testing.assert_array_equal(copy.last_seen(), last)
        np.testing.assert_array_equal(copy.observe(), env.observe())


@pytest.mark.parametrize("order", ["relevant", "slot"])
def test_rows_are_within_their_bounds(order: Any) -> None:
    scenario = sighted(obstacles=(DISC,), occlusion=True, victim_order=order)
    low, high = observation_bounds(scenario)
    env, rows = walked(scenario)
    assert rows.shape[-1] == len(low) == len(env.observation_names())
    assert ((low <= rows) & (rows <= high)).all()
    for name, least, most in zip(env.observation_names(), low, high, strict=True):
        if name.endswith(("seen", "present")):
            assert (least, most) == (0, 1), name
    view = parallel_env(scenario)
    found, _ = view.reset(seed=1)
    for robot, row in found.items():
        assert view.observation_space(robot).contains(row)


def test_frames_bring_turned_rows_to_one_form() -> None:
    env, rows = walked(sighted(None, 0.3, 0.5, 0.7, 0.3))
    check_frames_keep(rows, env.observation_names(), "seen")


def test_who_hears_nobody_sees_nobody_and_who_comes_back_has_been_unseen() -> None:
    deaf = Fault(robot="food_0", kind="lost_communication", value=1.0, onset_step=5)
    gone = Fault(robot="food_1", kind="unavailable", value=1.0, onset_step=3, duration_steps=4)
    scenario = sighted(None, 9.0, 9.0, 9.0, 9.0, faults=(deaf, gone), unavailable_robots="leave")
    env, rows = walked(scenario, 9)
    names = env.observation_names()
    seen, since = (names.index(f"teammate_0.{one}") for one in ("seen", "since_seen"))
    wanted = [0, 0, 0, 1, 2, 3, 4, 5, 6, 7]  # food_0 of food_1: gone at step 3, deaf at step 5
    tenths = 10 * rows[:, 0, 0, since] / (1 - rows[:, 0, 0, since])
    np.testing.assert_allclose(tenths, wanted, atol=1e-3)
    assert (rows[:, 0, 0, seen] == [1, 1, 1, *[0] * 7]).all()
    tenths = 10 * rows[:, 0, 2, since + 1] / (1 - rows[:, 0, 2, since + 1])
    assert rows[:, 0, 2, seen].all()
    column = names.index("teammate_1.seen")  # navigation_0 of food_1
    assert rows[:, 0, 2, column].tolist() == [1, 1, 1, 0, 0, 0, 0, 1, 1, 1]


def test_info_says_who_sees_how_far() -> None:
    words = scenario_words(sighted(None, 0.5, 0.5, None, 1.0, obstacles=(DISC,), occlusion=True))
    assert "food_0, food_1: sees teammates and victims up to 0.5 m away" in words
    assert "medical_0: sees teammates and victims up to 1 m away" in words
    assert "navigation_0: sees" not in words
    assert "Obstacles hide what is behind them." in words
    assert "sees" not in scenario_words(Scenario())
    words = scenario_words(Scenario(robots=(FAN, *Scenario().robots[1:])))
    assert "food_0: sees teammates and victims within 120 degrees ahead" in words


@pytest.mark.parametrize(
    ("scenario", "message"),
    [
        (
            sighted(None, None, 0.5, None, None),
            r"robots\[1\].sight_m = 0.5: must be left out; they",
        ),
        (
            Scenario(robots=(FAN, *Scenario().robots[1:])),
            r"robots\[0\].field_of_view_deg = 120: must be 360; they see everything",
        ),
        (Scenario(obstacles=(DISC,), occlusion=True), "occlusion = true: must be false; they see"),
    ],
)
def test_who_sees_everything_refuses_limited_sight(scenario: Scenario, message: str) -> None:
    refuse_stores_drives_and_senses(Scenario(), "they")
    with pytest.raises(ConfigError, match=message):
        refuse_stores_drives_and_senses(scenario, "they")


def test_worlds_that_are_limited_to_nothing_are_refused() -> None:
    with pytest.raises(ConfigError, match=r"robots\[0\].sight_m = 0.01: must be above radius_m"):
        sighted(None, 0.01, None, None, None)
    with pytest.raises(ConfigError, match="occlusion = true: must be false where there are no"):
        Scenario().replace(occlusion=True)
