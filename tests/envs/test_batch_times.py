"""Services and deadlines through `BatchEnv`: what is told of victims, and what becomes of them."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from innerattn.config import Scenario
from innerattn.envs import BatchEnv
from innerattn.envs.state import shares_left
from innerattn.errors import ConfigError

ENVS, STEPS = 8, 60


def scenario(situation: str = "double", **times: Any) -> Scenario:
    plain = Scenario.preset("mixed").replace(
        situation=situation, rescue_radius_m=0.6, victim_order="slot", lost_cost=0.5
    )
    return plain.replace(tasks=tuple(task.replace(**times) for task in plain.tasks))


def test_worlds_without_them_have_no_column_and_no_field() -> None:
    env = BatchEnv(scenario(), 2)
    names = env.observation_names() + env.state_names() + list(env.victims().dtype.names or ())
    assert not [name for name in names if "served" in name or "left" in name or "deadl" in name]
    env.reset()
    env.step(np.zeros((2, 4), np.int64))
    assert env.lost().dtype.names == ("env", "episode", "step", "slot", "victim", "task")
    assert len(env.lost()) == 0


@settings(max_examples=20)
@given(
    situation=st.sampled_from(["single", "double", "mixed"]),
    service=st.sampled_from([0.0, 0.2, 0.35]),
    kind=st.sampled_from(["keep", "restart"]),
    deadline=st.sampled_from([None, 0.7, (0.5, 1.5)]),
    seed=st.integers(0, 2**32),
    cut=st.integers(0, STEPS - 1),
)
def test_what_is_seen_and_what_happens(
    situation: str, service: float, kind: str, deadline: Any, seed: int, cut: int
) -> None:
    worlds = scenario(situation, service_s=service, service=kind, deadline_s=deadline)
    env, other = (BatchEnv(worlds, ENVS, seed + n, num_threads=1 + n) for n in (0, 1))
    env.reset()
    names, rng = env.observation_names(), np.random.default_rng(seed)
    columns = {
        one: [n for n, name in enumerate(names) if name.endswith(f".{one}")]
        for one in ("served", "time_left")
    }
    gone: set[tuple[int, int, int]] = set()
    for step in range(STEPS):
        if step == cut:
            other.restore(env.snapshot())
        before, episodes = env.victims(), env.episodes()
        actions = rng.integers(0, 5, (ENVS, 4))
        made = env.step(actions)
        lost = env.lost()
        if step >= cut:
            same = other.step(actions)
            assert made.obs.tobytes() == same.obs.tobytes()
            assert made.rescues.tobytes() == same.rescues.tobytes()
            assert lost.tobytes() == other.lost().tobytes()
        for row in (*made.rescues, *lost):
            victim = (int(row["env"]), int(episodes[row["env"]]), int(row["victim"]))
            assert victim not in gone
            gone.add(victim)
        for row in lost:
            age = row["step"] + 1 - before["appeared_step"][row["env"], row["slot"]]
            low, high = (deadline, deadline) if isinstance(deadline, float) else deadline
            assert low - 1e-9 <= 0.1 * age < high + 0.1
        victims, obs = env.victims(), made.obs
        if worlds.has_services:
            served = obs[:, :, columns["served"]]
            assert (served == victims["served"][:, None]).all()
            assert ((served >= 0) & (served < 1)).all()
        if worlds.has_deadlines:
            left = shares_left(worlds, victims, env.step_counts()) * victims["present"]
            assert (obs[:, :, columns["time_left"]] == left[:, None]).all()
        parts = env.reward_components()[..., env.reward_component_names.index("lost")]
        assert (parts == -0.5 * np.bincount(lost["env"], minlength=ENVS)[:, None]).all()


def test_a_victim_that_is_moved_keeps_its_service_and_one_of_another_task_does_not() -> None:
    env = BatchEnv(scenario("single", service_s=3.0, deadline_s=(3.0, 9.0)), 64, 3, num_threads=1)
    env.reset()
    for _ in range(3):
        env.step(np.zeros((64, 4), np.int64))
    before = env.victims()
    assert (before["served"] > 0).any()
    moved = before.copy()
    moved["x"] = -moved["x"]
    env.set_victims(moved)
    assert (env.victims() == moved).all()
    moved["task"] = 1 - moved["task"]
    env.set_victims(moved)
    after = env.victims()
    assert (after["served"] == 0).all()
    assert (after["appeared_step"] == before["appeared_step"]).all()
    assert (after["deadline_step"] == before["deadline_step"]).all(), "of one task as of the other"


@pytest.mark.parametrize(
    ("times", "message"),
    [
        ({"service_s": -1.0}, r"tasks\[0\]\.service_s = -1: must be in 0\.\.=1000000 s"),
        ({"service": "stop"}, r"tasks\[0\]\.service = 'stop': must be 'keep' or 'restart'"),
        ({"deadline_s": [1.0]}, r"deadline_s = \[1\.0\]: must be a number or a pair \[low, high\]"),
        ({"deadline_s": "soon"}, r"tasks\[0\]\.deadline_s = 'soon': must be a valid number"),
        ({"deadline_s": [3.0, 1.0]}, r"deadline_s = \[3, 1\]: must be a pair \[low, high\] whose"),
        ({"service_s": 2.0, "deadline_s": 1.0}, r"deadline_s = 1: must be at least service_s = 2"),
    ],
)
def test_bad_times_are_refused_in_one_line(times: dict[str, Any], message: str) -> None:
    first, second = Scenario.preset("mixed").model_dump()["tasks"]
    with pytest.raises(ConfigError, match=message) as error:
        Scenario.preset("mixed").replace(tasks=[{**first, **times}, second])
    assert "\n" not in str(error.value)
