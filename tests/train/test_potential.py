"""A script's value as a potential: what it may change, and how well it fits."""

import json
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
import torch
from numpy.typing import NDArray

from innerattn.config import Obstacle, RunConfig, Scenario, load_run_config
from innerattn.envs import BatchEnv
from innerattn.errors import ConfigError
from innerattn.learn.types import Learner
from innerattn.nn import NUM_ELEMENTS, SquareSymmetry
from innerattn.policies import PolicyInput, WorldState, scripted_policy
from innerattn.train import load_policy, train
from innerattn.train.build import build_learner, torch_threads
from innerattn.train.collect import Collector
from innerattn.train.columns import vector_columns
from innerattn.train.potential import Potential, fitted_potential
from innerattn.train.schedule import Schedule
from innerattn.train.script_play import play_script

WEIGHT = {"first": 2.0, "last": 0.5}


@pytest.fixture(autouse=True)
def one_thread() -> Iterator[None]:
    with torch_threads(1):
        yield


def go_on() -> None:
    """Nobody interrupts."""


def run(scenario: Scenario, method: str = "mappo", **values: object) -> RunConfig:
    shaped = {"train.potential": "hungarian", "train.threads": 1, "train.potential_env_steps": 5000}
    small = {"network.hidden_width": 8, "td.warmup_env_steps": 100_000, "td.replay_capacity": 2000}
    config = load_run_config(method=method, overrides={**shaped, **small, **values})
    return config.model_copy(update={"scenario": scenario})


@pytest.mark.parametrize("discount", [0.5, 0.98])
def test_shaping_changes_returns_only_by_the_potential_at_both_ends(discount: float) -> None:
    # Episodes end by time after 10 steps, and some by the first rescue before that.
    scenario = Scenario.preset("single").replace(episode_steps=10, end_when_rescued=1)
    config = run(scenario, **{"train.potential_discount": discount})
    ends = {"terminated": 0, "truncated": 0}
    with closing(BatchEnv(scenario, 200, seed=5, num_threads=1)) as env:
        potential, _ = fitted_potential(config, env, go_on)
        collector = shaped_collector(config, env, potential)
        first = potential.values(torch.from_numpy(env.observe()))
        shaped = torch.zeros(200, dtype=torch.float64)
        power = torch.ones(200, dtype=torch.float64)
        for _ in range(30):
            step, truncated = collector.step()
            assert step.reward_parts is not None
            assert torch.equal(step.reward_parts[:, 0, 4], step.reward_parts[:, 3, 4])
            shaped += power * step.reward_parts[:, 0, 4]
            power *= discount
            last = torch.where(step.terminated, 0.0, potential.values(step.next_obs))
            over = step.terminated | truncated
            expected = power * last - first
            torch.testing.assert_close(shaped[over], expected[over], rtol=1e-5, atol=1e-4)
            ends["terminated"] += int(step.terminated.sum())
            ends["truncated"] += int(truncated.sum())
            begins = potential.values(torch.from_numpy(env.observe()))
            first = torch.where(over, begins, first)
            shaped[over], power[over] = 0.0, 1.0
    assert min(ends.values()) > 20


def shaped_collector(config: RunConfig, env: BatchEnv, potential: Potential) -> Collector:
    """A collector in which `hungarian` acts and the potential shapes."""
    learner = build_learner(config, env)
    script = scripted_policy("hungarian", config.scenario)

    class Hungarian:
        def act(self, obs: torch.Tensor) -> torch.Tensor:
            view = PolicyInput(obs.numpy(), WorldState.of(env))
            return torch.from_numpy(script.act(view))

    schedule = Schedule(config, env, learner)
    schedule.shape(potential)
    hungarian: Learner = Hungarian()  # type: ignore[assignment]
    return Collector(env, hungarian, torch.device("cpu"), schedule)


def discounted_returns(
    scenario: Scenario, discount: float
) -> tuple[NDArray[np.float32], NDArray[np.float64]]:
    """Observations (n, R, D) on the way of `hungarian` and what it gets from there on (n,)."""
    steps, worlds, states = 150, 200, 50
    long = scenario.replace(episode_steps=steps)
    script = scripted_policy("hungarian", long)
    rewards = np.zeros((steps, worlds))
    seen = []
    with closing(BatchEnv(long, worlds, seed=99, num_threads=1)) as env:
        now = env.reset()
        for t in range(steps):
            seen.append(now.copy())
            step = env.step(script.act(PolicyInput(now, WorldState.of(env))))
            np.add.at(rewards[t], step.rescues["env"], scenario.rescue_reward)
            now = step.obs
    powers = discount ** np.arange(steps - states)
    windows = np.lib.stride_tricks.sliding_window_view(rewards, steps - states, axis=0)
    returns = windows[:states] @ powers
    return np.concatenate(seen[:states]), returns.reshape(-1)


@pytest.mark.long
@pytest.mark.parametrize(
    "obstacles", [(), (Obstacle(shape="disc", position_m=(0.0, 0.0), radius_m=0.1),)]
)
def test_the_potential_is_the_scripts_value(obstacles: tuple[Obstacle, ...]) -> None:
    # With this discount what the next victims will bring, which nobody can know, weighs little.
    scenario = Scenario.preset("single").replace(engine="discs", rescue_reward=2.0)
    if obstacles:
        scenario = scenario.replace(obstacles=[part.model_dump() for part in obstacles])
    values = {"train.potential_env_steps": 60_000, "train.potential_discount": 0.9}
    config = run(scenario, **values)
    with closing(BatchEnv(scenario, 1, num_threads=1)) as env:
        potential, correlation = fitted_potential(config, env, go_on)
    obs, returns = discounted_returns(scenario, 0.9)
    phi = potential.values(torch.from_numpy(obs)).numpy()
    assert np.corrcoef(phi, returns)[0, 1] > 0.8
    assert phi.mean() == pytest.approx(returns.mean(), rel=0.05)
    assert 0.8 < correlation < 1.0


def test_a_turned_state_has_the_same_potential() -> None:
    scenario = Scenario.preset("mixed")
    config = run(scenario)
    with closing(BatchEnv(scenario, 100, seed=3, num_threads=1)) as env:
        potential, _ = fitted_potential(config, env, go_on)
        obs = torch.from_numpy(env.reset())
        symmetry = SquareSymmetry(vector_columns(env.observation_names()), torch.device("cpu"))
    values = potential.values(obs)
    assert values.std() > 0.1
    for number in range(NUM_ELEMENTS):
        turned = symmetry.turn(obs, torch.full(obs.shape[:2], number))
        assert torch.equal(potential.values(turned), values)


def test_where_nobody_is_rescued_the_potential_is_nothing() -> None:
    # No robot reaches a victim in an episode of one step.
    scenario = Scenario.preset("mixed").replace(episode_steps=1)
    config = run(scenario, **{"train.potential": "random"})
    with closing(BatchEnv(scenario, 10, seed=3, num_threads=1)) as env:
        potential, correlation = fitted_potential(config, env, go_on)
        values = potential.values(torch.from_numpy(env.reset()))
    assert -1.0 <= correlation <= 1.0
    assert values.abs().max() < 1e-4


@pytest.mark.parametrize("after", [0, 3, 8])
def test_a_fit_can_be_interrupted(after: int) -> None:
    config = run(Scenario.preset("mixed"))
    calls = 0

    def press_ctrl_c() -> None:
        nonlocal calls
        calls += 1
        if calls > after:
            raise KeyboardInterrupt

    with (
        closing(BatchEnv(config.scenario, 10, seed=3, num_threads=1)) as env,
        pytest.raises(KeyboardInterrupt),
    ):
        fitted_potential(config, env, press_ctrl_c)
    assert calls == after + 1


def test_td_weighs_the_remembered_potential_anew() -> None:
    scenario = Scenario.preset("double")
    ramps = {"train.schedule": {"potential_weight": WEIGHT}}
    config = run(scenario, "td-inner", **ramps)
    with closing(BatchEnv(scenario, 50, seed=5, num_threads=1)) as env:
        potential, _ = fitted_potential(config, env, go_on)
        collector = shaped_collector(config, env, potential)
        learner = build_learner(config, env)
        schedule = Schedule(config, env, learner)
        seen = []
        for _ in range(20):
            transitions, truncated = collector.step()
            learner.observe(transitions, truncated)
            seen.append(transitions.reward_parts)
    parts = torch.cat([part for part in seen if part is not None]).double()
    assert parts.shape == (1000, 4, 5)
    for share, weight in ((0.0, 2.0), (0.5, 1.25), (1.0, 0.5)):
        schedule.set_progress(share)
        weights = torch.tensor([1.0, 0.0, 1.0, 1.0, weight], dtype=torch.float64)
        torch.testing.assert_close(learner.replay.reward_mean, (parts @ weights).mean(0))  # type: ignore[attr-defined]


def test_a_play_is_that_of_the_script() -> None:
    scenario = Scenario.preset("mixed").replace(episode_steps=20, rescue_reward=3.0)
    play = play_script("hungarian", scenario, 50 * 1024 - 5, seed=4, threads=1, check=go_on)
    script = scripted_policy("hungarian", scenario)
    reward, after = torch.zeros(50, 1024), []
    with closing(BatchEnv(scenario, 1024, seed=4, num_threads=1)) as env:
        now = env.reset()
        for t in range(50):
            assert torch.equal(play.obs[t], torch.tensor(now))
            step = env.step(script.act(PolicyInput(now, WorldState.of(env))))
            for event in step.rescues:
                reward[t, event["env"]] += 3.0
            if t in (19, 39, 49):
                after.append(torch.from_numpy(step.final_obs.copy()))
            now = step.obs
    assert torch.equal(play.reward, reward)
    assert torch.equal(play.after, torch.cat(after))
    assert play.ended.sum(1).nonzero().squeeze(1).tolist() == [19, 39]
    assert play.cut.sum(1).nonzero().squeeze(1).tolist() == [19, 39, 49]
    assert not play.terminated.any()
    other = play_script("hungarian", scenario, 50 * 1024 - 5, seed=5, threads=1, check=go_on)
    assert not torch.equal(play.obs, other.obs)


@pytest.mark.parametrize("method", ["mappo", "td-inner"])
@pytest.mark.long
def test_a_shaped_run_says_how_well_the_potential_fits_and_is_repeatable(
    small_config: Callable[..., RunConfig], tmp_path: Path, method: str
) -> None:
    values = {
        "train.method": method,
        "train.potential": "greedy",
        "train.potential_env_steps": 5_000,
        "ppo.rollout_steps": 10,
    }
    states = []
    for name, given in (("a", values), ("b", values), ("plain", {"train.method": method})):
        folder = train(small_config(**given), tmp_path / name)
        states.append(load_policy(folder)[1].state())
        lines = [json.loads(line) for line in (folder / "metrics.jsonl").read_text().splitlines()]
        told = ["potential_correlation" in line["losses"] for line in lines]
        assert told == [name != "plain", False, False]
    first, again, plain = states
    assert all(torch.equal(first[name], again[name]) for name in first)
    assert not all(torch.equal(first[name], plain[name]) for name in plain)


def test_a_learner_that_weighs_nothing_is_refused() -> None:
    class Other:
        """Lacks `follow`."""

    config = run(Scenario.preset("mixed"))
    other: Learner = Other()  # type: ignore[assignment]
    with (
        closing(BatchEnv(config.scenario, 1, num_threads=1)) as env,
        pytest.raises(ConfigError, match=r"train\.potential: method 'mappo' cannot follow one"),
    ):
        Schedule(config, env, other)
