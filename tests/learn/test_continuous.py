"""PPO over continuous actions, against the distributions of torch; and what it refuses."""

import pytest
import torch
from torch import Tensor
from torch.distributions import Independent, Normal, TransformedDistribution
from torch.distributions.transforms import TanhTransform

from innerattn.config import NetworkConfig, PPOConfig
from innerattn.learn import PPO, Team, Transitions
from innerattn.nn.actions import mean_and_log_std

CPU = torch.device("cpu")
R, D, W, ENVS, STEPS = 3, 5, 2, 4, 3
TEAM = Team(R, D, 0, kinds=("a", "a", "b"), action_width=W)


def make(attention: str = "inner", numbers: dict | None = None, **extra) -> PPO:
    network = NetworkConfig(hidden_width=8, attention_heads=2, attention=attention)
    given = {"rollout_steps": STEPS, "minibatch_size": 5, "advantage": "value", "clip": 0.01}
    return PPO(
        TEAM,
        network,
        PPOConfig(**{**given, **(numbers or {})}),
        **{"seed": 3, "device": CPU, "dtype": torch.float64, **extra},
    )


def play(learner: PPO, seed: int = 0) -> None:
    """A rollout in which the learner acts; the reward is the first number of its action."""
    source = torch.Generator().manual_seed(seed)
    obs = torch.randn(ENVS, R, D, generator=source)
    for step in range(STEPS):
        after = torch.randn(ENVS, R, D, generator=source)
        actions = learner.act(obs)
        ended = torch.tensor([step == 1, False, False, False])
        batch = Transitions(obs, actions, actions[..., 0].clone(), after, ended)
        learner.observe(batch, torch.zeros(ENVS, dtype=torch.bool))
        obs = after


def policies(outputs: Tensor) -> TransformedDistribution:
    mean, log_std = (part.mT for part in mean_and_log_std(outputs))
    return TransformedDistribution(Independent(Normal(mean, log_std.exp()), 1), [TanhTransform()])


@pytest.mark.parametrize("attention", ["inner", "uniform", "none"])
def test_rollouts_and_losses_are_those_of_torchs_distributions(attention: str) -> None:
    learner = make(attention)
    play(learner)
    rollout = learner._rollout()
    assert rollout.actions.shape == (R, STEPS * ENVS, W)
    before = policies(learner.actor(rollout.obs).detach()).log_prob(rollout.actions.double())
    torch.testing.assert_close(rollout.log_prob, before, rtol=1e-9, atol=1e-9)
    with torch.no_grad():
        for parameter in learner.actor.parameters():
            parameter.add_(0.02)
    outputs = learner.actor(rollout.obs).detach()
    log_prob = policies(outputs).log_prob(rollout.actions.double())
    ratio = (log_prob - before).exp()
    surrogate = torch.minimum(
        ratio * rollout.advantage, ratio.clamp(0.99, 1.01) * rollout.advantage
    )
    torch.manual_seed(0)
    many = policies(outputs.repeat_interleave(4000, dim=2))
    entropy = -many.log_prob(many.sample()).mean()
    found = dict(zip(PPO._metric_names, learner.update(rollout).tolist(), strict=True))
    assert found["policy_entropy"] == pytest.approx(float(entropy), abs=0.02)
    expected = -surrogate.mean(dim=1).sum() - 0.01 * R * found["policy_entropy"]
    assert found["actor_loss"] == pytest.approx(float(expected), abs=1e-9)
    assert 0.0 < found["clip_share"] < 1.0


def test_values_heed_the_actions_of_teammates_and_not_the_own_one() -> None:
    learner = make()
    obs = torch.randn(R, 6, D, generator=torch.Generator().manual_seed(1), dtype=torch.float64)
    actions = torch.zeros(R, 6, W)
    before = learner.critic(obs, actions).q
    assert before.shape == (R, 1, 6)
    actions[1, :, 1] = 0.5
    after = learner.critic(obs, actions).q
    assert torch.equal(after[1], before[1])
    for i in (0, 2):
        assert (after[i] - before[i]).abs().min() > 1e-6


def test_what_pays_is_done_more() -> None:
    """The reward is the first number of the action: it rises from about 0."""
    learner = make("uniform", {"learning_rate": 0.02, "epochs": 4, "clip": 0.2, "gamma": 0.0})
    obs = torch.randn(64, R, D, generator=torch.Generator().manual_seed(9))
    before = learner.act(obs, greedy=True)[..., 0].mean()
    assert abs(float(before)) < 0.4
    for seed in range(30):
        play(learner, seed)
        assert learner.learn() is not None
    assert float(learner.act(obs, greedy=True)[..., 0].mean()) > 0.8


@pytest.mark.long
@pytest.mark.parametrize("backend", ["aot_eager", pytest.param("inductor", marks=pytest.mark.slow)])
def test_the_compiled_update_agrees(backend: str) -> None:
    torch.compiler.reset()
    plain, compiled = make(), make()
    compiled.compile(backend)
    for learner in (plain, compiled):
        play(learner)
    rollout, _ = plain._rollout(), compiled._rollout()
    close = {"rel": 1e-9, "abs": 1e-9}
    for _ in range(2):
        expected = plain.update(rollout).tolist()
        assert compiled.update(rollout).tolist() == pytest.approx(expected, **close)
    state = compiled.state()
    for name, tensor in plain.state().items():
        torch.testing.assert_close(state[name], tensor, rtol=1e-9, atol=1e-9)


def test_a_rollout_goes_on_from_its_state() -> None:
    first, second = make(), make(seed=4)
    play(first)
    second.load(first.state())
    second.load_resume_state(first.resume_state())
    assert first.learn() == second.learn()
    play(first, 2)
    state = first.resume_state()
    state["buffer.actions"] = state["buffer.actions"] * 3.0
    with pytest.raises(ValueError, match=r"'actions': must be in -1\.\.=1"):
        second.load_resume_state(state)


def test_there_is_no_counterfactual_baseline() -> None:
    with pytest.raises(ValueError, match="continuous actions need 'value'"):
        make(numbers={"advantage": "counterfactual"})
