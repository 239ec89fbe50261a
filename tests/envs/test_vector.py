"""Gymnasium's interface of many worlds, beside `BatchEnv` and a `SyncVectorEnv` of single ones."""

from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from worlds import CROWDED

from innerattn.config import Scenario
from innerattn.envs import BatchEnv, RescueEnv, RescueVectorEnv

ID = "innerattn/Rescue-v0"
ENVS = 6
SEED = 11
MODES = list(AutoresetMode)
UNEVEN = CROWDED.replace(episode_steps=17, end_when_rescued=1)
"""Its episodes end at different steps, by rescues and by time."""


def same(one: Any, other: Any) -> bool:
    """Whether two results are equal to the last bit, with all types of arrays and keys of dicts."""
    if isinstance(one, dict):
        return one.keys() == other.keys() and all(same(one[key], other[key]) for key in one)
    if isinstance(one, np.ndarray) and one.dtype == object:
        pairs = zip(one, other, strict=True)
        return other.dtype == object and all(same(a, b) for a, b in pairs)
    if isinstance(one, np.ndarray):
        return one.dtype == other.dtype and one.shape == other.shape and bool((one == other).all())
    return type(one) is type(other) and bool(one == other)


@pytest.mark.parametrize(
    ("actions", "form", "copy"),
    [("discrete", "joint", False), ("discrete", "agents", True), ("continuous", "joint", True)],
)
@pytest.mark.parametrize("mode", MODES)
def test_agrees_with_gymnasiums_loop_over_single_worlds(
    mode: AutoresetMode, actions: Any, form: Any, copy: bool
) -> None:
    scenario = UNEVEN.replace(actions=actions)
    env = RescueVectorEnv(ENVS, scenario, autoreset_mode=mode, form=form, copy=copy)
    makers = [lambda i=i: RescueEnv(scenario, form=form, first_env=i) for i in range(ENVS)]
    loop = SyncVectorEnv(makers, autoreset_mode=mode)
    assert env.metadata["autoreset_mode"] is mode
    for name in ("single_observation_space", "single_action_space"):
        assert getattr(env, name) == getattr(loop, name)
    for name in ("observation_space", "action_space"):
        assert getattr(env, name) == getattr(loop, name)
    first = env.reset(seed=SEED)
    assert all(map(same, first, loop.reset(seed=[SEED] * ENVS)))
    env.action_space.seed(0)
    ends = {"terminated": 0, "truncated": 0, "steps with some but not all": 0}
    for _ in range(70):
        chosen = env.action_space.sample()
        found, wanted = env.step(chosen), loop.step(chosen)
        for name, one, other in zip(("obs", "r", "te", "tr", "infos"), found, wanted, strict=True):
            assert same(one, other), name
        assert env.observation_space.contains(found[0])
        over = found[2] | found[3]
        ends["terminated"] += int(found[2].sum())
        ends["truncated"] += int(found[3].sum())
        ends["steps with some but not all"] += int(over.any() and not over.all())
        if mode is AutoresetMode.DISABLED and over.any():
            options = {"reset_mask": over.copy()}
            seeds: Any = [None] * ENVS
            again = env.reset(options=dict(options))
            assert all(map(same, again, loop.reset(seed=seeds, options=options)))
    assert min(ends.values()) >= 3, ends


@pytest.mark.parametrize("mode", MODES)
def test_agrees_with_a_batch(mode: AutoresetMode) -> None:
    env = gymnasium.make_vec(ID, num_envs=ENVS, scenario=UNEVEN, autoreset_mode=mode)
    name: Any = {"SameStep": "same_step", "NextStep": "next_step", "Disabled": "disabled"}
    batch = BatchEnv(UNEVEN, ENVS, SEED, autoreset=name[mode.value])
    obs, _ = env.reset(seed=SEED)
    np.testing.assert_array_equal(obs, batch.reset())
    chance = np.random.default_rng(0)
    for _ in range(60):
        actions = chance.integers(5, size=(ENVS, 4))
        obs, rewards, terminated, truncated, _ = env.step(actions)
        step = batch.step(actions)
        np.testing.assert_array_equal(obs, step.obs)
        np.testing.assert_array_equal(rewards, step.reward.astype(float).sum(1))
        np.testing.assert_array_equal(terminated, step.terminated)
        np.testing.assert_array_equal(truncated, step.truncated)
        np.testing.assert_array_equal(env.unwrapped.state(), batch.state())
        over = terminated | truncated
        if mode is AutoresetMode.DISABLED and over.any():
            obs, _ = env.reset(options={"reset_mask": over})
            np.testing.assert_array_equal(obs, batch.reset(mask=over))


def test_in_the_next_step_a_batch_only_resets() -> None:
    """The plain reference: a batch without autoreset, whose ended worlds are reset and put back."""
    later, plain = (
        BatchEnv(UNEVEN, ENVS, SEED, autoreset=mode) for mode in ("next_step", "disabled")
    )
    waiting = np.zeros(ENVS, bool)
    later.reset(), plain.reset()
    chance = np.random.default_rng(1)
    begun = 0
    for _ in range(80):
        actions = chance.integers(5, size=(ENVS, 4))
        step = later.step(actions)
        first = plain.reset(mask=waiting) if waiting.any() else plain.observe()
        wanted = plain.step(actions)
        np.testing.assert_array_equal(step.obs[waiting], first[waiting])
        assert (step.reward[waiting] == 0).all()
        assert not (step.terminated | step.truncated)[waiting].any()
        np.testing.assert_array_equal(step.obs[~waiting], wanted.obs[~waiting])
        np.testing.assert_array_equal(step.reward[~waiting], wanted.reward[~waiting])
        begun += int(waiting.sum())
        plain.restore(later.snapshot())
        waiting = step.terminated | step.truncated
    assert begun > 10
    assert set(step.rescues.dtype.names or ()) >= {"env", "helper_0"}


def test_each_world_may_have_its_own_seed() -> None:
    env = RescueVectorEnv(3, UNEVEN, autoreset_mode="Disabled")
    obs, _ = env.reset(seed=[4, 9, 4])
    for seed, worlds in ((4, [0, 2]), (9, [1])):
        wanted, _ = RescueVectorEnv(3, UNEVEN).reset(seed=seed)
        np.testing.assert_array_equal(obs[worlds], wanted[worlds])
    with pytest.raises(ValueError, match="seed has 2 values: must be 3"):
        env.reset(seed=[1, 2])
    with pytest.raises(ValueError, match=r"seed\[2\] = -1: must be in 0"):
        env.reset(seed=[1, 2, -1])
    for wrong in (1.5, "many"):
        with pytest.raises(TypeError, match=f"seed = {wrong!r}: must be an integer, None, or a"):
            env.reset(seed=wrong)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("mask", "error", "message"),
    [
        ([True, False], TypeError, "is no array"),
        (np.array([1, 0]), TypeError, "has dtype int64"),
        (np.array([True]), ValueError, r"has shape \(1,\)"),
        (np.array([False, False]), ValueError, "is all False"),
    ],
)
def test_wrong_masks_change_nothing(mask: Any, error: type[Exception], message: str) -> None:
    env = RescueVectorEnv(2, autoreset_mode=AutoresetMode.DISABLED)
    env.reset(seed=0)
    before = env.state()
    with pytest.raises(error, match=rf"options\['reset_mask'\] {message}: must be a bool array"):
        env.reset(options={"reset_mask": mask})
    np.testing.assert_array_equal(env.state(), before)


def test_what_needs_a_reset_is_refused_before_it() -> None:
    env = RescueVectorEnv(2, autoreset_mode="Disabled", episode_steps=1)
    with pytest.raises(ResetNeeded, match="reset"):
        env.step(np.zeros((2, 4), int))
    with pytest.raises(ResetNeeded, match="the first reset"):
        env.reset(options={"reset_mask": np.array([True, False])})
    env.reset(options={"reset_mask": np.array([True, True])})
    env.step(np.zeros((2, 4), int))
    with pytest.raises(ValueError, match="env 0: its episode is over"):
        env.step(np.zeros((2, 4), int))


def test_copies_are_ones_own_and_views_are_not() -> None:
    views, copies = RescueVectorEnv(2, copy=False), RescueVectorEnv(2)
    for env in (views, copies):
        env.reset(seed=0)
        first, *_ = env.step(np.ones((2, 4), int))
        kept = first.copy()
        env.step(np.ones((2, 4), int))
        env.step(np.ones((2, 4), int))
        assert (first == kept).all() == (env is copies)
        assert first.flags.writeable == (env is copies)
    with pytest.raises(TypeError, match="copy = 1: must be True or False"):
        RescueVectorEnv(2, copy=1)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="same_step"):
        RescueVectorEnv(2, autoreset_mode="same_step")


def test_gymnasiums_wrappers_work_on_it() -> None:
    env = gymnasium.make_vec(ID, num_envs=3, autoreset_mode=AutoresetMode.SAME_STEP)
    recorded = gymnasium.wrappers.vector.RecordEpisodeStatistics(env)
    recorded.reset(seed=0)
    for _ in range(25):
        *_, infos = recorded.step(recorded.action_space.sample())
    assert infos["episode"]["l"].tolist() == [25] * 3
    assert infos["final_obs"][0].shape == (4, 44)


def test_each_world_has_its_picture() -> None:
    env = RescueVectorEnv(2, render_mode="rgb_array")
    env.reset(seed=0)
    frames = env.render()
    assert frames is not None
    assert [frame.shape[2] for frame in frames] == [3, 3]
    assert (frames[0] != frames[1]).any()
    assert RescueVectorEnv(2).render() is None
    env.close()
    assert env.closed
    with pytest.raises(RuntimeError, match="closed"):
        env.reset()


def test_long_episodes_by_either_name() -> None:
    for options in ({"max_episode_steps": 40}, {"episode_steps": 40}):
        env = gymnasium.make_vec(ID, num_envs=1, **options)
        assert env.unwrapped.scenario == Scenario.preset("mixed").replace(episode_steps=40)
