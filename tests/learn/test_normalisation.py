"""Rewards, returns and advantages that are scaled: what the scaling must not change."""

import math

import pytest
import torch
from torch import Tensor

from innerattn.config import NetworkConfig, PPOConfig, TDConfig
from innerattn.learn import PPO, TD, Team, Transitions
from innerattn.learn.advantage import ReturnScale
from innerattn.learn.ppo import _split
from innerattn.learn.rollout import standardised

CPU = torch.device("cpu")
TEAM = Team(2, 1, 2)
NETWORK = NetworkConfig(hidden_width=8, attention_heads=2)
WAIT, FINISH = 0, 1


def waiting(actions: Tensor) -> tuple[Transitions, Tensor]:
    """One state: a robot that waits is paid -1; when robot 0 finishes, -5, and it is over."""
    worlds = len(actions)
    finished = actions[:, 0] == FINISH
    reward = torch.where(finished, -5.0, -1.0).unsqueeze(1).expand(worlds, 2)
    obs = torch.ones(worlds, 2, 1)
    return Transitions(obs, actions, reward, obs, finished), torch.zeros(worlds, dtype=torch.bool)


@pytest.mark.long
@pytest.mark.parametrize("algorithm", ["td", "ppo"])
def test_finishing_beats_waiting_for_ever(algorithm: str) -> None:
    """With gamma 0.9 waiting for ever is worth -10, finishing -5."""
    learner: TD | PPO
    if algorithm == "td":
        numbers = {"gamma": 0.9, "batch_size": 64, "warmup_env_steps": 64, "reward_scale": 100.0}
        numbers |= {"update_every_env_steps": 16, "replay_capacity": 2_000, "polyak": 0.1}
        team = TEAM._replace(terminates=True)
        learner = TD(team, NETWORK, TDConfig(**numbers), seed=0, device=CPU)
    else:
        numbers = {"gamma": 0.9, "rollout_steps": 16, "minibatch_size": 64, "learning_rate": 0.01}
        learner = PPO(TEAM, NETWORK, PPOConfig(**numbers), seed=0, device=CPU)
    obs = torch.ones(16, 2, 1)
    for _ in range(400):
        learner.observe(*waiting(learner.act(obs)))
        learner.learn()
    finishes = torch.stack([learner.act(obs)[:, 0] for _ in range(20)]) == FINISH
    assert finishes.double().mean() > 0.9


@pytest.mark.parametrize("terminates", [False, True])
def test_rewards_are_centred_where_no_episode_terminates(
    terminates: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    team = TEAM._replace(terminates=terminates)
    learner = TD(team, NETWORK, TDConfig(replay_capacity=256), seed=0, device=CPU)
    obs, none = torch.ones(4, 2, 1), torch.zeros(4, dtype=torch.bool)
    reward = torch.tensor([[0.0, 1.0], [0.0, 3.0], [2.0, 5.0], [2.0, 7.0]])
    batch = Transitions(obs, torch.zeros(4, 2, dtype=torch.int64), reward, obs, none)
    learner.observe(batch, none)
    seen: list[Tensor] = []
    monkeypatch.setattr(learner, "_update", lambda *given: seen.append(given[2]))
    learner.update(batch)
    mean = 0.0 if terminates else reward.mean(0)
    wanted = (reward - mean) / reward.std(0, correction=0)
    torch.testing.assert_close(seen[0], wanted.t())


@pytest.mark.parametrize("value", [0.0, 0.1, -3.7, 1e4 + 0.1, 1e20])
@pytest.mark.parametrize("rows", [1, 3, 400])
@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_equal_advantages_are_none(value: float, rows: int, dtype: torch.dtype) -> None:
    found = standardised(torch.full((2, rows), value, dtype=dtype))
    assert found.dtype == dtype
    assert found.abs().max() == 0.0


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_advantages_that_are_not_finite_stay_so(value: float) -> None:
    found = standardised(torch.tensor([[1.0, value, 3.0], [1.0, 2.0, 3.0]]))
    assert found[0].isnan().all()
    assert found[1].isfinite().all()


def test_other_advantages_have_mean_0_and_deviation_1() -> None:
    given = torch.randn(3, 400, generator=torch.Generator().manual_seed(1)) * 1e-3 + 5.0
    found = standardised(given)
    mean, deviation = given.mean(1, keepdim=True), given.std(1, correction=0, keepdim=True)
    assert torch.equal(found, (given - mean) / (deviation + 1e-8))


def test_without_any_reward_the_policy_stays_as_random_as_it_is() -> None:
    team, numbers = Team(2, 3, 5), {"rollout_steps": 8, "minibatch_size": 64, "entropy_weight": 0.0}
    learner = PPO(team, NETWORK, PPOConfig(**numbers), seed=0, device=CPU)
    source = torch.Generator().manual_seed(2)
    before = {name: value.clone() for name, value in learner.actor.state_dict().items()}
    none = torch.zeros(32, dtype=torch.bool)
    for _ in range(80):
        obs, after = (torch.randn(32, 2, 3, generator=source) for _ in range(2))
        steps = Transitions(obs, learner.act(obs), torch.zeros(32, 2), after, none)
        learner.observe(steps, none)
        learner.learn()
    assert learner.updates > 0
    assert all(torch.equal(before[name], now) for name, now in learner.actor.state_dict().items())


def test_spread_is_of_returns_and_not_of_rounding() -> None:
    ended = torch.ones(9, 5, dtype=torch.bool)
    scale = ReturnScale(3, 0.9, CPU)
    rewards = torch.tensor([0.0, 0.1, 0.1]).reshape(1, 3, 1).repeat(9, 1, 5)
    rewards[4, 2, 3] = 0.2
    for _ in range(4):
        scale.update(rewards, ended)
    assert scale.has_spread().tolist() == [False, False, True]


@pytest.mark.parametrize(("rows", "size"), [(10, 4), (401, 400), (1, 400), (800, 400), (7, 7)])
def test_minibatches_are_of_one_size(rows: int, size: int) -> None:
    order = torch.randperm(rows)
    parts = _split(order, size)
    assert torch.equal(torch.cat(parts), order)
    sizes = [len(part) for part in parts]
    assert len(sizes) == math.ceil(rows / size)
    assert max(sizes) <= size
    assert max(sizes) - min(sizes) <= 1


def test_a_dropped_rollout_leaves_no_open_return() -> None:
    learner = PPO(TEAM, NETWORK, PPOConfig(rollout_steps=4), seed=0, device=CPU)
    obs, none = torch.ones(3, 2, 1), torch.zeros(3, dtype=torch.bool)

    def observe(reward: float, steps: int) -> None:
        for _ in range(steps):
            paid = torch.full((3, 2), reward)
            learner.observe(Transitions(obs, learner.act(obs), paid, obs, none), none)
            learner.learn()

    learner.actor_frozen = True
    observe(100.0, 6)  # a rollout, and half of the next one
    learner.actor_frozen = False
    fresh = ReturnScale(2, learner.scale.gamma, CPU)
    learner.scale = fresh_scale(learner.scale)
    observe(0.0, 4)
    assert learner.scale.mean.tolist() == [0.0, 0.0]
    assert fresh.count == 0


def fresh_scale(scale: ReturnScale) -> ReturnScale:
    """Without moments, but with the returns that are open."""
    found = ReturnScale(2, scale.gamma, CPU)
    found._open = scale._open
    return found


def test_imitation_does_not_end_the_passes_of_the_critic() -> None:
    numbers = {"rollout_steps": 4, "minibatch_size": 12, "epochs": 3, "stop_at_kl": 1e-9}
    learner = PPO(TEAM, NETWORK, PPOConfig(**numbers), seed=0, device=CPU)
    obs, none = torch.ones(3, 2, 1), torch.zeros(3, dtype=torch.bool)
    learner.actor_frozen = True
    for step in range(4):
        actions = learner.act(obs)
        learner.observe(Transitions(obs, actions, torch.rand(3, 2), obs, none), none)
        learner.imitate(obs, torch.full((3, 2), step % 2), 0.1)
    learner.learn()
    assert learner.updates == 3
