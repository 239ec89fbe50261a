"""A step of imitation against cross-entropy and Adam by hand; actors that are frozen."""

import copy

import pytest
import torch
from torch import Tensor

from innerattn.config import NetworkConfig, PPOConfig, TDConfig
from innerattn.learn import PPO, TD, Team, Transitions

TEAM = Team(3, 6, 5)
NETWORK = NetworkConfig(hidden_width=8, attention_heads=2)


def make(kind: type, dtype: torch.dtype = torch.float32) -> TD | PPO:
    numbers = (
        TDConfig(batch_size=8, replay_capacity=64, warmup_env_steps=8, update_every_env_steps=8)
        if kind is TD
        else PPOConfig(rollout_steps=2, minibatch_size=8)
    )
    return kind(TEAM, NETWORK, numbers, seed=0, device=torch.device("cpu"), dtype=dtype)


def states(seed: int, count: int) -> Tensor:
    return torch.randn(count, *TEAM[:2], generator=torch.Generator().manual_seed(seed))


def rule(obs: Tensor) -> Tensor:
    """A simple one: the largest of the first five columns."""
    return obs[:, :, :5].argmax(dim=2)


def transitions(seed: int) -> Transitions:
    obs, after = states(seed, 8), states(seed + 100, 8)
    return Transitions(obs, rule(after), obs[:, :, 0], after, torch.zeros(8, dtype=torch.bool))


def changed(learner: TD | PPO, before: dict[str, Tensor]) -> set[str]:
    """The networks and optimisers that are not what they were."""
    after = learner.state()
    return {name.split(".")[0] for name in before if not torch.equal(before[name], after[name])}


def test_steps_against_cross_entropy_and_adam_by_hand() -> None:
    learner = make(PPO, torch.float64)
    plain = copy.deepcopy(learner.actor)
    first = [torch.zeros_like(p) for p in plain.parameters()]
    second = [torch.zeros_like(p) for p in plain.parameters()]
    for count in (1, 2, 3):
        obs, rate = states(count, 7), 0.01 / count
        logits = plain(obs.double().transpose(0, 1))  # (R, A, B)
        total = torch.zeros((), dtype=torch.float64)
        for b in range(7):
            for robot in range(3):
                scores = logits[robot, :, b]
                total = total - (scores[rule(obs)[b, robot]] - scores.exp().sum().log()) / 7
        gradients = torch.autograd.grad(total, list(plain.parameters()))
        with torch.no_grad():
            for p, g, m, v in zip(plain.parameters(), gradients, first, second, strict=True):
                m.copy_(0.9 * m + 0.1 * g)
                v.copy_(0.999 * v + 0.001 * g * g)
                mean, square = m / (1 - 0.9**count), v / (1 - 0.999**count)
                p -= rate * mean / (square.sqrt() + 1e-8)
        loss = learner.imitate(obs, rule(obs), rate)
        assert loss == pytest.approx(float(total.detach()) / 3, abs=1e-12)
        for found, p in zip(learner.actor.parameters(), plain.parameters(), strict=True):
            torch.testing.assert_close(found, p, atol=1e-12, rtol=0.0)
    assert learner.updates == 0


@pytest.mark.parametrize("kind", [TD, PPO])
def test_a_simple_rule_is_soon_imitated(kind: type) -> None:
    learner = make(kind)
    before = learner.state()
    for seed in range(400):
        obs = states(seed, 128)
        learner.imitate(obs, rule(obs), 0.01)
    slow_copy = {"target_actor"} if kind is TD else set()
    assert changed(learner, before) == {"actor", "actor_adam"} | slow_copy
    obs = states(1000, 2000)
    assert (learner.act(obs, greedy=True) == rule(obs)).float().mean() > 0.9


@pytest.mark.parametrize("kind", [TD, PPO])
def test_frozen_actors_stay_while_the_critic_learns(kind: type) -> None:
    learner = make(kind)
    before = learner.state()
    learner.actor_frozen = True
    for seed in range(4):
        learner.observe(transitions(seed), torch.zeros(8, dtype=torch.bool))
        learner.learn()
    assert learner.updates > 0
    assert {"critic", "critic_adam"} <= changed(learner, before)
    assert not {"actor", "actor_adam"} & changed(learner, before)
    learner.actor_frozen = False
    for seed in range(4):
        learner.observe(transitions(seed), torch.zeros(8, dtype=torch.bool))
        learner.learn()
    assert {"actor", "actor_adam"} <= changed(learner, before)


def test_td_looks_ahead_with_the_policy_that_imitates() -> None:
    learner = make(TD)
    for seed in range(3):
        learner.imitate(states(seed, 8), rule(states(seed, 8)), 0.01)
        for slow, own in zip(
            learner.target_actor.parameters(), learner.actor.parameters(), strict=True
        ):
            assert torch.equal(slow, own)


def test_ppo_learns_nothing_from_steps_of_another_policy() -> None:
    """Steps while it was frozen are as if they had never been, and the other way round."""
    never = torch.zeros(8, dtype=torch.bool)

    def learnt(seeds: list[int], frozen_first: bool) -> dict[str, Tensor]:
        learner = make(PPO)
        for number, seed in enumerate(seeds):
            learner.actor_frozen = frozen_first and number == 0
            learner.observe(transitions(seed), never)
            learner.learn()
        assert learner.updates > 0
        return learner.state()

    clean, mixed, whole = learnt([1, 2], False), learnt([0, 1, 2], True), learnt([0, 1], False)
    assert all(torch.equal(clean[name], mixed[name]) for name in clean)
    assert not all(torch.equal(clean[name], whole[name]) for name in clean)
