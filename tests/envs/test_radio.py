"""Communication as Python sees it: arrays, columns, bounds, frames, words, what is refused."""

from collections import deque
from typing import Any

import numpy as np
import pytest
from framed_rows import check_frames_keep

from innerattn.config import Communication, Scenario
from innerattn.config.refusals import refuse_stores_drives_and_senses
from innerattn.envs import BatchEnv, parallel_env
from innerattn.envs.bounds import observation_bounds
from innerattn.errors import ConfigError
from innerattn.report.scenario_words import scenario_words

ENVS = 6
SLACK_M = 1e-5


def told(sight_m: float | None = None, **communication: Any) -> Scenario:
    """The default team that communicates so."""
    plain = Scenario()
    robots = tuple(robot.replace(sight_m=sight_m) for robot in plain.robots)
    return plain.replace(robots=robots, communication=Communication(**communication))


def walked(env: BatchEnv, steps: int) -> np.ndarray:
    """All observations of some random steps."""
    rng, rows = np.random.default_rng(0), [env.reset()]
    for _ in range(steps):
        rows.append(env.step(rng.integers(0, 5, (env.num_envs, env.num_robots))).obs)
    return np.stack(rows)


@pytest.mark.parametrize("delay", [0, 1, 3])
@pytest.mark.parametrize("range_m", [None, 0.6])
@pytest.mark.parametrize("loss", [0.0, 0.4])
def test_who_is_heard_and_what_is_told_is_as_a_plain_memory_says(
    delay: int, range_m: float | None, loss: float
) -> None:
    """In float64, from places and from what each robot saw itself, by a twin that tells nothing."""
    scenario = told(0.5, delay_steps=delay, range_m=range_m, loss=loss, share="victims")
    env = BatchEnv(scenario, ENVS, seed=3, num_threads=1)
    twin = BatchEnv(scenario.replace(communication=None), ENVS, seed=3, num_threads=1)
    rng = np.random.default_rng(1)
    env.reset(), twin.reset()
    slots, robots = scenario.num_victims, scenario.num_robots
    past: list[deque[tuple[np.ndarray, np.ndarray]]] = [
        deque(maxlen=delay + 1) for _ in range(ENVS)
    ]
    known = np.full((ENVS, robots, slots), -1)
    counts = {"heard": 0, "not heard": 0, "told": 0, "void": 0}
    for step in range(120):
        if step:
            actions = rng.integers(0, 5, (ENVS, robots))
            env.step(actions), twin.step(actions)
        np.testing.assert_array_equal(env.positions(), twin.positions())
        own, heard, steps = twin.last_seen()[:, :, robots:], env.heard(), env.step_counts()
        victims = env.victims()
        assert not heard[:, range(robots), range(robots)].any()
        for world in range(ENVS):
            if steps[world] == 0:
                past[world].clear()
                known[world] = -1
            at = env.positions()[world].astype(np.float64)
            sees = own[world] == steps[world]
            past[world].append((np.linalg.norm(at[:, None] - at, axis=-1), sees))
            appeared = np.where(victims["present"][world], victims["appeared_step"][world], 10**6)
            hears = heard[world]
            if len(past[world]) <= delay:
                assert not hears.any()
            else:
                distance, seen = past[world][0]
                most = np.inf if range_m is None else range_m
                others = ~np.eye(robots, dtype=bool)
                assert not (hears & (distance > most + SLACK_M)).any()
                assert loss or hears[(distance < most - SLACK_M) & others].all()
                sent = int(steps[world]) - delay
                news = (hears[:, :, None] & seen).any(1)
                counts["void"] += int((news & (sent < appeared)).sum())
                counts["told"] += int((news & (sent >= appeared)).sum())
                known[world] = np.where(news, sent, known[world])
            known[world] = np.where(known[world] >= appeared, known[world], -1)
            counts["heard"] += int(hears.sum())
            counts["not heard"] += int((~hears).sum()) - robots
        wanted = np.maximum(known, own)
        np.testing.assert_array_equal(env.last_seen()[:, :, robots:], wanted)
    assert counts["heard"] > 500
    assert counts["told"] > 50
    assert (counts["not heard"] > 200) == bool(delay or range_m or loss)


def test_columns_say_who_is_heard() -> None:
    env = BatchEnv(told(range_m=0.7, loss=0.2), ENVS, seed=3, num_threads=1)
    rows, names = walked(env, 30), env.observation_names()
    columns = [name.endswith(".heard") for name in names]
    assert [name for name in names if "heard" in name] == [
        f"teammate_{mate}.heard" for mate in range(3)
    ]
    others = np.array([[other for other in range(4) if other != own] for own in range(4)])
    heard = np.take_along_axis(env.heard(), others[None], 2)
    np.testing.assert_array_equal(rows[-1][..., columns], heard)
    assert 0.1 < rows[..., columns].mean() < 0.9
    low, high = observation_bounds(env.scenario)
    assert ((low <= rows) & (rows <= high)).all()
    assert (low[columns] == 0).all()
    assert (high[columns] == 1).all()
    view = parallel_env(env.scenario)
    found, _ = view.reset(seed=1)
    assert all(view.observation_space(robot).contains(row) for robot, row in found.items())


def test_without_limits_all_others_are_heard_and_there_are_no_columns() -> None:
    for scenario in (Scenario(), told(), told(0.5, share="victims")):
        env = BatchEnv(scenario, ENVS, num_threads=1)
        walked(env, 5)
        assert not any("heard" in name for name in env.observation_names())
        assert (env.heard() == ~np.eye(4, dtype=bool)).all()


def test_what_is_on_its_way_is_in_a_snapshot() -> None:
    scenario = told(0.4, delay_steps=3, loss=0.3, range_m=1.0, share="victims")
    one, two = (BatchEnv(scenario, ENVS, seed=seed, num_threads=1) for seed in (1, 2))
    walked(one, 14)
    two.restore(one.snapshot())
    for _ in range(9):
        actions = np.ones((ENVS, 4), np.int64)
        np.testing.assert_array_equal(one.step(actions).obs, two.step(actions).obs)
        np.testing.assert_array_equal(one.heard(), two.heard())
        np.testing.assert_array_equal(one.last_seen(), two.last_seen())


def test_frames_leave_who_is_heard_alone() -> None:
    env = BatchEnv(told(0.5, range_m=0.7, share="victims"), ENVS, seed=3, num_threads=1)
    check_frames_keep(walked(env, 30), env.observation_names(), ".heard")


def test_info_says_who_hears_whom() -> None:
    words = scenario_words(told(0.5, range_m=0.8, delay_steps=2, loss=0.1, share="victims"))
    for line in (
        "Robots hear each other up to 0.8 m away.",
        "Robots hear what was sent 0.2 s before.",
        "Of what robots send, 0.1 is lost.",
        "Robots tell those who hear them which victims they see.",
    ):
        assert line in words.splitlines()
    assert "hear" not in scenario_words(told())


def test_who_does_not_know_who_hears_whom_refuses_limits() -> None:
    for free in (Scenario(), told()):
        refuse_stores_drives_and_senses(free, "they")
    with pytest.raises(
        ConfigError, match=r"^scenario.communication = { range_m = 0.5 }: must be left out; they"
    ):
        refuse_stores_drives_and_senses(told(range_m=0.5), "they")


def test_bad_values_are_refused() -> None:
    for found, message in (
        ({"range_m": 0.0}, "communication.range_m = 0: must be in 0.005..=1000 m"),
        ({"delay_steps": 21}, "communication.delay_steps = 21: must be in 0..=20"),
        ({"loss": 1.0}, "communication.loss = 1: must be at least 0 and below 1"),
        ({"share": "victims"}, 'communication.share = "victims": must be "nothing" where no sight'),
    ):
        with pytest.raises(ValueError, match=f"scenario.{message}"):
            told(**found)
