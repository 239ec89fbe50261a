"""The fast learner against the plain form of `reference.py`, in float64."""

import pytest
import torch
from reference import PlainTD, policy, values
from scipy.stats import chi2_contingency, chisquare
from torch import Tensor

from innerattn.config import NetworkConfig, TDConfig
from innerattn.learn import TD, Team, Transitions, td

CPU = torch.device("cpu")
OBS_WIDTH, NUM_ACTIONS, BATCH = 5, 3, 7
AVAILABLE = 4  # column of the observation
NETWORK = {"hidden_width": 8, "attention_heads": 2}
NUMBERS = {
    "batch_size": BATCH,
    "replay_capacity": 64,
    "attention_logit_penalty": 0.1,
    "critic_weight_decay": 0.01,
    "reward_scale": 5.0,
    "polyak": 0.1,
}


def make(
    robots: int,
    network: dict | None = None,
    numbers: dict | None = None,
    column: int | None = None,
    **extra,
) -> TD:
    return TD(
        Team(robots, OBS_WIDTH, NUM_ACTIONS, availability_column=column),
        NetworkConfig(**{**NETWORK, **(network or {})}),
        TDConfig(**{**NUMBERS, **(numbers or {})}),
        **{"seed": 3, "device": CPU, "dtype": torch.float64, **extra},
    )


def transitions(robots: int, seed: int, batch: int = BATCH) -> Transitions:
    source = torch.Generator().manual_seed(seed)
    return Transitions(
        torch.randn(batch, robots, OBS_WIDTH, generator=source),
        torch.randint(NUM_ACTIONS, (batch, robots), generator=source),
        torch.randn(batch, robots, generator=source) + 0.3,
        torch.randn(batch, robots, OBS_WIDTH, generator=source),
        torch.arange(batch) % 3 == 0,
    )


def double(batch: Transitions) -> Transitions:
    return Transitions(*(x.double() if x.is_floating_point() else x for x in batch[:5]))


class Draws:
    """Records what the learner draws, and hands it to the plain form in the same order."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.drawn: list[tuple[Tensor, Tensor]] = []
        original = td.sample_actions

        def recording(log_prob: Tensor, generator: torch.Generator) -> Tensor:
            actions = original(log_prob, generator)
            self.drawn.append((log_prob.detach().clone(), actions))
            return actions

        monkeypatch.setattr(td, "sample_actions", recording)

    def replay(self, log_prob: list[Tensor]) -> Tensor:
        fast, actions = self.drawn.pop(0)
        close(fast, torch.stack([x.detach().T for x in log_prob]))
        return actions.T


def close(got: Tensor, expected: Tensor) -> None:
    torch.testing.assert_close(got, expected, rtol=1e-10, atol=1e-10)


def compare(learner: TD, plain: PlainTD, draws: Draws, batches: list[Transitions]) -> None:
    """An update by each batch; losses, gradients, weights and target weights must agree."""
    rewards = []
    for batch in batches:
        learner.observe(batch, torch.zeros(BATCH, dtype=torch.bool))
        rewards.append(batch.reward.double())
        held = torch.cat(rewards)
        metrics = dict(zip(td._METRICS, learner.update(batch).tolist(), strict=True))
        plain.update(double(batch), held.mean(0), held.std(0, correction=0), draws.replay)
        assert metrics == pytest.approx(plain.figures, rel=1e-10, abs=1e-10)
        for name, network in (("actor", learner.actor), ("critic", learner.critic)):
            for key, parameter in network.named_parameters():
                gradient = parameter.grad
                expected = plain.gradients[f"{name}.{key}"]
                close(torch.zeros_like(expected) if gradient is None else gradient, expected)
        state = learner.state()
        for key, tensor in plain.joined().items():
            close(state[key], tensor)
    assert not draws.drawn
    assert learner.updates == len(batches)


@pytest.mark.long
@pytest.mark.parametrize("entropy_target", ["consistent", "maac"])
@pytest.mark.parametrize("policy_gradient", ["expected", "sampled"])
@pytest.mark.parametrize("attention", ["inner", "uniform"])
@pytest.mark.parametrize("robots", [1, 2, 3, 4, 8])
def test_updates_agree_with_the_plain_form(
    robots: int,
    attention: str,
    policy_gradient: str,
    entropy_target: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    numbers = {"policy_gradient": policy_gradient, "entropy_target": entropy_target}
    if robots == 1:  # its attention has no gradient at all in the plain form, zeros in the fast one
        numbers["critic_weight_decay"] = 0.0
    learner = make(robots, {"attention": attention}, numbers)
    plain = PlainTD(learner.state(), NetworkConfig(**NETWORK, attention=attention), learner._config)
    compare(learner, plain, Draws(monkeypatch), [transitions(robots, seed) for seed in range(3)])


def test_clipped_updates_agree_with_the_plain_form(monkeypatch: pytest.MonkeyPatch) -> None:
    learner = make(4, numbers={"critic_grad_clip": 0.3, "actor_grad_clip": 0.02})
    plain = PlainTD(learner.state(), NetworkConfig(**NETWORK), learner._config)
    compare(learner, plain, Draws(monkeypatch), [transitions(4, seed) for seed in range(3)])
    for i in range(4):
        clipped = torch.cat([p.grad[i].flatten() for p in learner.actor.parameters()])
        assert clipped.norm().item() == pytest.approx(0.02, rel=1e-3)


@pytest.mark.parametrize("attention", ["inner", "uniform"])
def test_masked_updates_agree_with_the_plain_form(
    attention: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    network = {"attention": attention, "mask_unavailable": True}
    learner = make(3, network, column=AVAILABLE)
    plain = PlainTD(
        learner.state(), NetworkConfig(**NETWORK, **network), learner._config, AVAILABLE
    )
    batches = [transitions(3, seed) for seed in range(3)]
    for batch in batches:
        for obs in (batch.obs, batch.next_obs):
            obs[:, :, AVAILABLE] = (obs[:, :, AVAILABLE] > 0).float()
            obs[0, :, AVAILABLE] = 0.0  # nobody is available
            obs[1, :, AVAILABLE] = torch.tensor([1.0, 0.0, 0.0])  # nobody but the first
    compare(learner, plain, Draws(monkeypatch), batches)


@pytest.mark.parametrize("column", [None, -1, OBS_WIDTH])
def test_masking_needs_a_column_of_the_observation(column: int | None) -> None:
    with pytest.raises(ValueError, match=r"availability_column = .*0\.\.4"):
        make(3, {"mask_unavailable": True}, column=column)


@pytest.mark.parametrize("kinds", [None, ("food", "food")])
def test_sharing_by_kind_needs_the_kinds_of_the_team(kinds: tuple[str, ...] | None) -> None:
    network, team = NetworkConfig(parameter_sharing="kind"), Team(3, 4, 5, kinds)
    with pytest.raises(ValueError, match=r"^kinds = .*'kind' needs those of 3 robots$"):
        TD(team, network, TDConfig(), seed=1, device=torch.device("cpu"))


@pytest.mark.parametrize("attention", ["inner", "uniform"])
@pytest.mark.parametrize("robots", [1, 2, 4])
def test_attention_weights_agree_with_the_plain_form(robots: int, attention: str) -> None:
    learner = make(robots, {"attention": attention})
    batch = transitions(robots, seed=5)
    weights = learner.attention(batch.obs, batch.actions)
    plain = PlainTD(learner.state(), NetworkConfig(**NETWORK, attention=attention), learner._config)
    out = values(plain.networks["critic"], batch.obs.double(), batch.actions, attention)
    close(weights, out.weights)
    assert weights.shape == (BATCH, 2, robots, robots)
    assert not weights.diagonal(dim1=2, dim2=3).any()
    close(weights.sum(3), torch.full((BATCH, 2, robots), float(robots > 1), dtype=torch.float64))


def test_reward_statistics_with_a_floor_keep_constant_rewards_finite() -> None:
    learner = make(2, dtype=torch.float32)
    batch = transitions(2, seed=1)._replace(reward=torch.full((BATCH, 2), 0.1))
    learner.observe(batch, torch.zeros(BATCH, dtype=torch.bool))
    for _ in range(20):
        assert learner.update(learner.replay.sample(BATCH)).isfinite().all()
    assert all(tensor.isfinite().all() for tensor in learner.state().values())


def test_one_seed_gives_the_same_bytes_and_another_does_not() -> None:
    def trained(seed: int) -> tuple[dict[str, Tensor], Tensor]:
        learner = make(4, dtype=torch.float32, seed=seed)
        learner.observe(transitions(4, seed=0, batch=50), torch.zeros(50, dtype=torch.bool))
        for _ in range(5):
            learner.update(learner.replay.sample(BATCH))
        return learner.state(), learner.act(transitions(4, seed=1, batch=50).obs)

    (first, first_actions), (second, second_actions) = trained(0), trained(0)
    assert all(torch.equal(first[name], second[name]) for name in first)
    assert torch.equal(first_actions, second_actions)
    other, other_actions = trained(1)
    assert not torch.equal(first["actor.first.weight"], other["actor.first.weight"])
    assert not torch.equal(first_actions, other_actions)


def test_updates_come_due_by_env_steps_after_the_warm_up() -> None:
    numbers = {"warmup_env_steps": 20, "update_every_env_steps": 8, "batch_size": 4}
    learner = make(2, numbers=numbers)
    done = []
    for step in range(6):
        learner.observe(transitions(2, seed=step), torch.zeros(BATCH, dtype=torch.bool))
        metrics = learner.learn()
        done.append(learner.updates)
        assert (metrics is None) == (done[-1] == (done[-2] if step else 0))
    # 7 env-steps at a time: the memory holds 21 after the third, when counting starts.
    assert done == [0, 0, 0, 1, 2, 3]
    learner.observe(transitions(2, seed=9, batch=64), torch.zeros(64, dtype=torch.bool))
    metrics = learner.learn()
    assert learner.updates == 11
    assert metrics is not None
    assert set(metrics) == set(td._METRICS)


@pytest.mark.parametrize(("share", "rate"), [(0.0, 0.01), (0.5, 0.006), (1.0, 0.002)])
def test_the_step_size_falls_evenly(share: float, rate: float) -> None:
    """Adam's first step is as long as the step size, whatever the gradient."""
    numbers = {"learning_rate": 0.01, "final_learning_rate_share": 0.2}
    learner = make(2, numbers=numbers)
    before = learner.state()
    learner.set_progress(share)
    learner.update(transitions(2, seed=1))
    after = learner.state()
    moved = (after["critic.output.bias"] - before["critic.output.bias"]).abs()
    assert moved.max().item() == pytest.approx(rate, rel=1e-3)


def test_actions_follow_the_policy() -> None:
    learner = make(3, dtype=torch.float32)
    obs = transitions(3, seed=2, batch=1).obs
    plain = PlainTD(learner.state(), NetworkConfig(**NETWORK), learner._config)
    log_prob = policy(plain.networks["actor"], obs)
    draws = 20_000
    actions = learner.act(obs.expand(draws, -1, -1))
    assert actions.shape == (draws, 3)
    assert actions.dtype == torch.int64
    assert actions.is_contiguous()
    for i in range(3):
        expected = log_prob[i][0].detach().double().exp()
        counts = torch.bincount(actions[:, i], minlength=NUM_ACTIONS).numpy()
        assert chisquare(counts, (expected / expected.sum() * draws).numpy()).pvalue > 1e-3
    joint = torch.bincount(actions[:, 0] * NUM_ACTIONS + actions[:, 1], minlength=9).view(3, 3)
    assert chi2_contingency(joint.numpy()).pvalue > 1e-3  # robots draw independently
    best = torch.stack([x.argmax(1) for x in log_prob], 1)
    assert torch.equal(learner.act(obs, greedy=True), best)


@pytest.mark.parametrize("policy_gradient", ["expected", "sampled"])
def test_two_robots_learn_to_act_as_they_are_told(policy_gradient: str) -> None:
    # Each robot is told which action the team is paid for; both must take it for a reward.
    learner = TD(
        Team(2, 3, 3),
        NetworkConfig(hidden_width=16, attention_heads=2),
        TDConfig(
            batch_size=64,
            replay_capacity=5_000,
            learning_rate=0.01,
            update_every_env_steps=32,
            warmup_env_steps=500,
            policy_gradient=policy_gradient,
        ),
        seed=0,
        device=CPU,
    )
    source = torch.Generator().manual_seed(0)
    for _ in range(200):
        wanted = torch.randint(3, (32,), generator=source)
        obs = torch.eye(3)[wanted].unsqueeze(1).repeat(1, 2, 1)
        actions = learner.act(obs)
        right = (actions == wanted.unsqueeze(1)).all(1, keepdim=True)
        ended = torch.ones(32, dtype=torch.bool)
        batch = Transitions(obs, actions, right.float().repeat(1, 2), obs, ended)
        learner.observe(batch, ~ended)
        learner.learn()
    obs = torch.eye(3).unsqueeze(1).repeat(1, 2, 1)
    expected = torch.arange(3).unsqueeze(1).repeat(1, 2)
    assert torch.equal(learner.act(obs, greedy=True), expected)
    assert (learner.act(obs.repeat(200, 1, 1)) == expected.repeat(200, 1)).float().mean() > 0.9
