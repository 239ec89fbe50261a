"""The seam to the compiled worlds: arrays, resets, determinism, processes and threads."""

import os
import subprocess
import sys
import threading
from itertools import combinations

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from worlds import CONTINUOUS, CROWDED, batch, image, plan

from innerattn import _core
from innerattn.config import Scenario
from innerattn.envs import BatchEnv

# Arrays


@pytest.mark.parametrize("copy", [False, True])
def test_shapes_and_dtypes(copy: bool) -> None:
    env = batch(6, copy=copy)
    width = len(env.observation_names())
    step = env.step(plan(1, 6)[0])
    assert env.obs_width == width
    wanted = {
        "obs": ((6, 4, width), "f4"),
        "reward": ((6, 4), "f4"),
        "terminated": ((6,), "?"),
        "truncated": ((6,), "?"),
        "final_obs": ((6, 4, width), "f4"),
    }
    for name, (shape, dtype) in wanted.items():
        array = getattr(step, name)
        assert (array.shape, array.dtype) == (shape, np.dtype(dtype)), name
        assert array.flags.c_contiguous
        assert array.flags.writeable == copy
        assert array.flags.aligned
    assert step.rescues.ndim == 1
    assert step.rescues.dtype.names == (
        *("env", "episode", "step", "slot", "victim", "task", "helper_0", "helper_1"),
    )
    assert all(step.rescues.dtype[name] == np.int64 for name in step.rescues.dtype.names)
    for array, shape, dtype in [
        (env.observe(), (6, 4, width), "f4"),
        (env.positions(), (6, 4, 2), "f4"),
        (env.velocities(), (6, 4, 2), "f4"),
        (env.obstacles(), (6, 2, 2), "f4"),
        (env.reward_components(), (6, 4, len(env.reward_component_names)), "f4"),
        (env.step_counts(), (6,), "i8"),
        (env.episodes(), (6,), "i8"),
    ]:
        assert (array.shape, array.dtype) == (shape, np.dtype(dtype))
        assert array.flags.c_contiguous
    assert env.victims().shape == (6, 2)


def test_attributes_follow_the_scenario() -> None:
    env = batch(2, Scenario())
    assert (env.num_envs, env.num_robots, env.num_actions, env.continuous) == (2, 4, 5, False)
    assert env.robot_names == ("food_0", "food_1", "navigation_0", "medical_0")
    assert BatchEnv("double", 1).scenario == Scenario.preset("double")
    assert (batch(2, CONTINUOUS).num_actions, batch(2, CONTINUOUS).continuous) == (0, True)


def test_a_scenario_is_checked_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """A batch takes what the check returned: nothing is checked twice or left unchecked."""
    checked, check = [], _core.Rules

    def count(json: str) -> _core.Rules:
        checked.append(json)
        return check(json)

    monkeypatch.setattr(_core, "Rules", count)
    scenario = Scenario.preset("double")
    for num_envs in (1, 3):
        assert BatchEnv(scenario, num_envs).observe().shape[0] == num_envs
    assert checked == [scenario.model_dump_json()]
    with pytest.raises(TypeError, match="Rules"):
        _core.Batch(scenario.model_dump_json(), 1, 0, None, 0, "disabled", True)  # type: ignore[arg-type]


def test_views_are_read_only_and_last_until_the_step_after_next() -> None:
    env = batch(8, copy=False)
    actions = plan(3, 8)
    first = env.step(actions[0])
    for array in (*first[:5], env.reward_components()):
        assert not isinstance(array.base, np.ndarray)  # which could be resized
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 0
        with pytest.raises(ValueError, match="cannot set WRITEABLE"):
            array.flags.writeable = True
        with pytest.raises(ValueError, match="does not own its data"):
            array.resize((1,) * array.ndim, refcheck=False)
    kept = [array.copy() for array in first]
    second = env.step(actions[1])
    for held, view in zip(kept, first, strict=True):
        assert held.tobytes() == view.tobytes()
    assert not any(np.shares_memory(a, b) for a, b in zip(first, second, strict=True))
    third = env.step(actions[2])
    assert all(np.shares_memory(a, b) for a, b in zip(first[:5], third[:5], strict=True))


def test_views_outlive_the_environment() -> None:
    env = batch(8, copy=False)
    obs = env.step(plan(1, 8)[0]).obs
    held = obs.copy()
    env.close()
    del env
    junk = [np.full(obs.shape, 7.0, np.float32) for _ in range(50)]
    assert (obs == held).all()
    assert len(junk) == 50


def test_what_a_step_gives_is_the_callers_own() -> None:
    env, views = batch(8), batch(8, copy=False)
    actions = plan(6, 8)
    steps = [env.step(action) for action in actions]
    for action, copied in zip(actions, steps, strict=True):
        assert all((a == b).all() for a, b in zip(views.step(action), copied, strict=True))
    steps[0].obs[...] = 0  # it is the caller's own
    assert env.observe().any()


Held = tuple[object, bytes]


def held(array: np.ndarray, how: int) -> Held:
    """Something that leads to the memory of an array, and what is there now."""
    kept: list[object] = [
        array,
        array[1:],
        array.reshape(-1)[::2],
        memoryview(array),
        torch.from_numpy(array)[:2],
        torch.from_dlpack(array),
        np.from_dlpack(array).T,
    ]
    return kept[how], np.asarray(kept[how]).tobytes()


@given(st.lists(st.tuples(st.integers(0, 4), st.integers(0, 6), st.booleans()), max_size=40))
def test_nothing_that_somebody_keeps_is_written_again(
    choices: list[tuple[int, int, bool]],
) -> None:
    """Slices, buffers and tensors keep an array as it is, in whatever order they go."""
    env, views = batch(8), batch(8, copy=False)
    actions = plan(4, 8)
    kept: list[Held] = []
    for number, (field, how, lets_go) in enumerate(choices):
        step, wanted = env.step(actions[number % 4]), views.step(actions[number % 4])
        assert all((a == b).all() for a, b in zip(step, wanted, strict=True))
        kept.append(held(step[field], how))
        if lets_go:
            del kept[0]
        del step
        assert all(np.asarray(one).tobytes() == before for one, before in kept)


def test_memory_that_nobody_has_is_used_again() -> None:
    env = batch(8)
    actions = plan(12, 8)
    places, every_tenth = set(), []
    for action in actions:
        step = env.step(action)
        places.add(step.obs.ctypes.data)
        step.obs[...] = np.nan  # it is the caller's own
        step.terminated.view(np.uint8)[...] = 7
    assert len(places) == 2, "the last step and the one before it"
    for number in range(40):
        step = env.step(actions[number % 12])
        assert np.isfinite(step.obs).all()
        assert set(step.terminated.view(np.uint8)) <= {0, 1}
        if number % 10 == 0:
            every_tenth.append((step.obs, step.obs.copy()))
    assert all((own == copy).all() for own, copy in every_tenth)
    assert len({own.ctypes.data for own, _ in every_tenth}) == 4


def test_an_array_of_a_step_is_neither_resized_nor_freed_under_another() -> None:
    env = batch(8)
    obs = env.step(plan(1, 8)[0]).obs
    with pytest.raises(ValueError, match="does not own its data"):
        obs.resize((1, 1, 1), refcheck=False)
    assert not isinstance(obs.base, np.ndarray)
    before = obs.copy()
    env.close()
    del env
    assert (obs == before).all()


def test_what_reset_and_observe_give_is_the_callers_own() -> None:
    env = batch(8)
    seen = [env.reset(seed=seed) for seed in range(4)] + [env.observe() for _ in range(3)]
    for seed, obs in enumerate(seen[:4]):
        assert (obs == batch(8, seed=seed).observe()).all()
    assert not any(np.shares_memory(a, b) for a, b in combinations(seen, 2))
    seen[-1][...] = 0.0
    assert (env.observe() == seen[3]).all()


def test_actions_that_are_not_aligned_are_actions() -> None:
    env, plain = batch(2), batch(2)
    actions = plan(1, 2)[0].astype(np.int64)
    shifted = np.frombuffer(b"." + actions.tobytes(), np.int64, offset=1).reshape(actions.shape)
    assert not shifted.flags.aligned
    assert (env.step(shifted).obs == plain.step(actions).obs).all()


def test_looking_changes_nothing() -> None:
    """Observing between steps must not exchange the reward components for older ones."""
    env = batch(8, Scenario(action_cost=1.0))
    env.step(np.zeros((8, 4), int))
    step = env.step(np.ones((8, 4), int))
    before, parts = env.snapshot(), env.reward_components().copy()
    assert parts[:, :, 3].tolist() == [[-1.0] * 4] * 8
    assert env.observe().tobytes() == step.obs.tobytes()
    assert env.reward_components().tobytes() == parts.tobytes()
    assert env.snapshot() == before


@pytest.mark.parametrize("look", [BatchEnv.observe, lambda env: env.reset(mask=[False] * 8)])
def test_looking_shortens_no_view_s_life(look) -> None:
    env = batch(8, autoreset="disabled", copy=False)
    actions = plan(3, 8)
    first = env.step(actions[0])
    held = [array.copy() for array in first]
    look(env)
    env.step(actions[1])
    for kept, view in zip(held, first, strict=True):
        assert kept.tobytes() == view.tobytes()


def test_rewards_are_the_sum_of_the_components() -> None:
    env = batch(50, Scenario(contact_cost=0.5, action_cost=0.1, arena_half_width_m=0.4))
    names = env.reward_component_names
    contact, action = names.index("contact"), names.index("action")
    touched = 0
    for actions in plan(20, 50):
        step, parts = env.step(actions), env.reward_components()
        np.testing.assert_allclose(step.reward, parts.sum(-1), atol=1e-6)
        assert np.isin(parts[:, :, contact], [0.0, -0.5]).all()
        np.testing.assert_allclose(parts[:, :, action], -0.1 * (actions > 0), atol=1e-7)
        touched += int((parts[:, :, contact] < 0).sum())
    assert touched > 100


# Resets


def test_same_step_autoreset() -> None:
    env, other = batch(20), batch(20, autoreset="disabled")
    ended = goals = 0
    for actions in plan(120, 20):
        step, wanted = env.step(actions), other.step(actions)
        over = step.terminated | step.truncated
        assert (step.terminated == wanted.terminated).all()
        assert (step.truncated == wanted.truncated).all()
        assert step.final_obs.tobytes() == wanted.final_obs.tobytes() == wanted.obs.tobytes()
        assert step.obs[~over].tobytes() == step.final_obs[~over].tobytes()
        assert (step.obs[over] != step.final_obs[over]).any((1, 2)).all()
        first = other.reset(mask=over)
        assert step.obs.tobytes() == first.tobytes()
        assert (env.step_counts()[over] == 0).all()
        assert (env.episodes() == other.episodes()).all()
        ended, goals = ended + over.sum(), goals + step.terminated.sum()
    assert ended >= 50
    assert goals >= 5
    assert env.episodes().sum() == ended


def test_ended_worlds_wait_when_autoreset_is_disabled() -> None:
    env = batch(3, Scenario(episode_steps=4), autoreset="disabled")
    env.step(plan(1, 3)[0])
    env.reset(mask=[True, False, False])
    for actions in plan(3, 3):
        step = env.step(actions)
    assert step.truncated.tolist() == [False, True, True]
    before = env.snapshot()
    with pytest.raises(ValueError, match=r"^env 1: its episode is over"):
        env.step(plan(1, 3)[0])
    assert env.snapshot() == before
    held = env.positions()
    obs = env.reset(mask=np.array([False, True, False]))
    assert env.step_counts().tolist() == [3, 0, 4]
    assert env.episodes().tolist() == [1, 1, 0]
    assert (obs[[0, 2]] == step.obs[[0, 2]]).all()
    assert (env.positions()[1] != held[1]).any()
    with pytest.raises(ValueError, match=r"^env 2: its episode is over"):
        env.step(plan(1, 3)[0])
    env.reset(mask=np.array([False, False, True]))
    assert env.step(plan(1, 3)[0]).truncated.tolist() == [True, False, False]


def test_seeds() -> None:
    fresh = BatchEnv(CROWDED, 5, seed=9)
    first = fresh.reset().copy()
    assert (fresh.episodes() == 0).all()
    assert (fresh.reset() != first).any((1, 2)).all()
    assert (fresh.episodes() == 1).all()
    other = batch(5, seed=4)
    other.step(plan(1, 5)[0])
    assert (other.observe() != first).any((1, 2)).all()
    assert other.reset(seed=9).tobytes() == first.tobytes()
    assert (other.episodes() == 0).all()
    again = batch(5, seed=9)
    for actions in plan(60, 5):
        assert image(other.step(actions), other) == image(again.step(actions), again)


def test_a_new_environment_may_step_before_its_first_reset() -> None:
    direct, usual = BatchEnv(CROWDED, 4, seed=5), batch(4)
    actions = plan(1, 4)[0]
    assert image(direct.step(actions), direct) == image(usual.step(actions), usual)


def test_a_seed_with_a_mask_touches_only_those_worlds() -> None:
    env, wanted = batch(4), batch(4, seed=77)
    env.step(plan(1, 4)[0])
    kept = env.observe().copy()
    obs = env.reset(seed=77, mask=[False, True, False, False])
    assert (obs[[0, 2, 3]] == kept[[0, 2, 3]]).all()
    assert obs[1].tobytes() == wanted.observe()[1].tobytes()


# Determinism


def test_threads_and_neighbours_change_no_byte() -> None:
    count, steps = 100, 110
    envs = [batch(count, num_threads=threads) for threads in (1, 2, 3)]
    alone = {i: batch(1, first_env=i) for i in (0, 1, 42, 99)}
    tail = batch(30, first_env=70, num_threads=2)
    rescues = 0
    for actions in plan(steps, count):
        results = [env.step(actions) for env in envs]
        images = [image(result, env) for result, env in zip(results, envs, strict=True)]
        assert images[1] == images[0]
        assert images[2] == images[0]
        for i, env in alone.items():
            single = env.step(actions[i : i + 1])
            there = slice(i, i + 1)
            assert image(single, env, shift=i) == image(results[0], envs[0], there)
        part = image(tail.step(actions[70:]), tail, shift=70)
        assert part == image(results[0], envs[0], slice(70, 100))
        rescues += len(results[0].rescues)
    assert rescues >= 500
    assert envs[0].episodes().min() >= 2
    assert envs[0].snapshot() == envs[1].snapshot() == envs[2].snapshot()


def test_worlds_differ_from_each_other_and_between_seeds() -> None:
    obs = np.concatenate([batch(50).observe(), batch(50, seed=6).observe()])
    assert len({row.tobytes() for row in obs}) == 100


# Processes and threads

FORK = """
import os, warnings
import numpy as np
from innerattn.envs import BatchEnv

warnings.simplefilter("ignore", DeprecationWarning)
env = BatchEnv("mixed", 64, num_threads=2)
env.reset()
actions = np.ones((64, 4), int)
env.step(actions)
image = env.snapshot()
child = os.fork()
if child == 0:
    code = 1
    try:
        refused = 0
        for attempt in (lambda: env.step(actions), env.reset, lambda: env.restore(image)):
            try:
                attempt()
            except RuntimeError as error:
                refused += "fork" in str(error)
        env.close()
        own = BatchEnv("mixed", 64, num_threads=2)
        own.restore(image)
        own.step(actions)
        code = 0 if refused == 3 else 2
    finally:
        os._exit(code)
_, status = os.waitpid(child, 0)
env.step(actions)
raise SystemExit(os.waitstatus_to_exitcode(status))
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system has no fork")
def test_a_forked_child_is_told_instead_of_hanging() -> None:
    done = subprocess.run(
        [sys.executable, "-c", FORK], timeout=60, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


def test_two_threads_in_one_environment_are_told() -> None:
    env = batch(4000, Scenario())
    actions = plan(1, 4000)[0]
    failures: list[Exception] = []
    counts = [0, 0]
    enough = threading.Event()

    def drive(who: int) -> None:
        for _ in range(300):
            if enough.is_set():
                return
            try:
                env.step(actions)
                counts[who] += 1
            except Exception as error:
                failures.append(error)
                enough.set()

    threads = [threading.Thread(target=drive, args=(who,)) for who in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60)
    assert failures
    assert all(isinstance(error, RuntimeError) for error in failures), failures
    alone = batch(4000, Scenario())  # the steps that were done are whole ones
    for _ in range(sum(counts)):
        alone.step(actions)
    assert alone.snapshot() == env.snapshot()


def test_other_threads_run_during_a_step() -> None:
    env = batch(20_000, Scenario())
    actions = plan(1, 20_000)[0]
    ticks, stop = 0, threading.Event()

    def tick() -> None:
        nonlocal ticks
        while not stop.wait(0.001):
            ticks += 1

    thread = threading.Thread(target=tick)
    thread.start()
    before = ticks
    env.step(actions)
    during = ticks - before
    stop.set()
    thread.join()
    assert during >= 2
