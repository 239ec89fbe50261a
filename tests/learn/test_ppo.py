"""The on-policy learner against a plain form of it, in float64: rollouts, losses, updates."""

import numpy as np
import pytest
import torch
from reference_ppo import PlainPPO
from torch import Tensor

from innerattn.config import NetworkConfig, PPOConfig
from innerattn.learn import PPO, Team, Transitions, ppo
from innerattn.learn.interruptions import NoInterruptions
from innerattn.learn.types import Scheduled
from innerattn.nn import actions

CPU = torch.device("cpu")
OBS_WIDTH, NUM_ACTIONS, ENVS, STEPS = 5, 3, 4, 3
NETWORK = {"hidden_width": 8, "attention_heads": 2}
NUMBERS = {
    "rollout_steps": STEPS,
    "minibatch_size": 5,
    "epochs": 2,
    "gamma": 0.9,
    "gae_lambda": 0.8,
    "clip": 0.01,
    "attention_logit_penalty": 0.1,
    "critic_weight_decay": 0.01,
    "learning_rate": 0.01,
}


def make(robots: int, network: dict | None = None, numbers: dict | None = None, **extra) -> PPO:
    return PPO(
        Team(robots, OBS_WIDTH, NUM_ACTIONS),
        NetworkConfig(**{**NETWORK, **(network or {})}),
        PPOConfig(**{**NUMBERS, **(numbers or {})}),
        **{"seed": 3, "device": CPU, "dtype": torch.float64, **extra},
    )


def collect(learner: PPO, robots: int, seed: int) -> list[tuple[Transitions, Tensor]]:
    """A rollout of worlds that go on, some of which end, shown to the learner."""
    source = torch.Generator().manual_seed(seed)
    obs = torch.randn(ENVS, robots, OBS_WIDTH, generator=source)
    steps = []
    for step in range(STEPS):
        after = torch.randn(ENVS, robots, OBS_WIDTH, generator=source)
        terminated = torch.tensor([step == 1, False, False, False])
        truncated = torch.tensor([False, step == 0, step == 2, False])
        batch = Transitions(
            obs,
            torch.randint(NUM_ACTIONS, (ENVS, robots), generator=source),
            torch.randn(ENVS, robots, generator=source) + 0.3,
            after,
            terminated,
        )
        steps.append((batch, truncated))
        learner.observe(batch, truncated)
        fresh = torch.randn(ENVS, robots, OBS_WIDTH, generator=source)
        obs = torch.where((terminated | truncated).view(-1, 1, 1), fresh, after)
    return steps


def close(got: Tensor, expected: Tensor) -> None:
    torch.testing.assert_close(got, expected, rtol=1e-10, atol=1e-10)


@pytest.mark.parametrize(
    ("attention", "advantage"),
    [
        ("inner", "counterfactual"),
        ("inner", "value"),
        ("uniform", "counterfactual"),
        ("uniform", "value"),
        ("none", "value"),
    ],
)
@pytest.mark.parametrize("robots", [2, 3])
def test_rollouts_and_updates_agree_with_the_plain_form(
    robots: int,
    attention: str,
    advantage: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    learner = make(robots, {"attention": attention}, {"advantage": advantage})
    network = NetworkConfig(**NETWORK, attention=attention)
    plain = PlainPPO(learner.state(), network, learner._config, NUM_ACTIONS)
    drawn: list[Tensor] = []
    original = actions.sample_actions

    def recording(logits: Tensor, generator: torch.Generator) -> Tensor:
        drawn.append(original(logits, generator))
        return drawn[-1]

    monkeypatch.setattr(actions, "sample_actions", recording)
    clipped = 0.0
    for round_ in range(2):
        steps = collect(learner, robots, round_)
        rollout = learner._rollout()
        learner._buffer.clear()
        expected = plain.rollout(steps, drawn[-1])
        close(rollout.advantage, expected["advantage"])
        close(rollout.target, expected["target"])
        for first in (0, 3, 6):
            chosen = torch.arange(first, first + 6)
            rows = rollout.take(chosen)
            figures = plain.update(rows, rows.obs.transpose(0, 1), rows.actions.t())
            found = dict(zip(ppo.METRICS, learner.update(rows).tolist(), strict=True))
            assert found == pytest.approx(figures, rel=1e-10, abs=1e-10)
            clipped += found["clip_share"]
            state = learner.state()
            for name, tensor in (
                plain.actor.joined("actor") | plain.critic.joined("critic")
            ).items():
                close(state[name], tensor)
    assert clipped > 0, "a test in which nothing is clipped proves little"


def test_learning_waits_for_a_full_rollout_and_then_uses_every_row() -> None:
    learner = make(2)
    steps = collect(learner, 2, 0)
    learner._buffer.clear()
    for batch, truncated in steps[:-1]:
        learner.observe(batch, truncated)
        assert learner.learn() is None
    learner.observe(*steps[-1])
    found = learner.learn()
    assert found is not None
    assert found.keys() == set(ppo.METRICS)
    assert learner.updates == 2 * 3, "two epochs of 12 rows in minibatches of 5"
    assert learner.learn() is None


class StopAfter(NoInterruptions):
    """Asks to stop after some updates."""

    def __init__(self, updates: int) -> None:
        self.left = updates

    def check(self) -> None:
        self.left -= 1
        if self.left < 0:
            raise KeyboardInterrupt


def test_passes_go_on_from_a_state_that_has_values_of_the_rollout_too() -> None:
    whole, first, second = make(2), make(2), make(2)
    for learner in (whole, first):
        collect(learner, 2, 0)
    first.interruptions = StopAfter(4)
    with pytest.raises(KeyboardInterrupt):
        first.learn()
    state = first.resume_state()
    state["rollout.value"] = torch.zeros_like(state["rollout.target"])  # as states once had
    second.load(first.state())
    second.load_resume_state(state)
    assert second.learn() == whole.learn()


def test_a_large_divergence_ends_the_epochs() -> None:
    numbers = {"epochs": 50, "learning_rate": 0.05, "clip": 0.9}
    free, held = make(2, numbers=numbers), make(2, numbers=numbers | {"stop_at_kl": 0.01})
    divergences: list[float] = []
    original = held.update
    kl = ppo.METRICS.index("kl")

    def watched(rows: ppo.Rollout) -> Tensor:
        figures = original(rows)
        divergences.append(float(figures[kl]))
        return figures

    held.update = watched  # type: ignore[method-assign]
    for learner in (free, held):
        collect(learner, 2, 0)
        learner.learn()
    assert free.updates == 50 * 3
    assert held.updates == len(divergences) < free.updates
    by_epoch = np.reshape(divergences, (-1, 3)).mean(1)
    assert (by_epoch[:-1] <= 0.01).all()
    assert by_epoch[-1] > 0.01


def test_one_seed_gives_the_same_bytes_and_another_does_not() -> None:
    def run(seed: int) -> dict[str, Tensor]:
        learner = make(3, seed=seed)
        for round_ in range(2):
            collect(learner, 3, round_)
            learner.learn()
        return learner.state()

    first, again, other = run(1), run(1), run(2)
    assert all(torch.equal(first[name], again[name]) for name in first)
    assert not torch.equal(first["actor.first.weight"], other["actor.first.weight"])


@pytest.mark.parametrize("robots", [1, 2])
def test_constant_rewards_and_a_robot_alone_stay_finite(robots: int) -> None:
    learner = make(robots)
    for batch, truncated in collect(make(robots), robots, 0):
        learner.observe(batch._replace(reward=torch.ones_like(batch.reward)), truncated)
    learner.learn()
    assert all(torch.isfinite(tensor).all() for tensor in learner.state().values())


def test_without_attention_values_heed_no_action_and_nothing_is_attended_to() -> None:
    first, other = (make(3, {"attention": "none"}, {"advantage": "value"}) for _ in range(2))
    for batch, truncated in collect(first, 3, 0):
        other.observe(batch._replace(actions=(batch.actions + 1) % NUM_ACTIONS), truncated)
    assert first.attention(batch.obs, batch.actions) is None
    one, two = first._rollout(), other._rollout()
    assert torch.equal(one.target, two.target)
    assert torch.equal(one.advantage, two.advantage)
    assert not torch.equal(one.log_prob, two.log_prob)


def test_a_loaded_learner_equals_the_saved_one() -> None:
    saved, loaded = make(3), make(3, seed=9)
    collect(saved, 3, 0)
    saved.learn()
    loaded.load(saved.state())
    assert loaded.updates == saved.updates
    assert loaded.scale.std(1e-3).tolist() == saved.scale.std(1e-3).tolist()
    obs = torch.randn(6, 3, OBS_WIDTH)
    assert torch.equal(loaded.act(obs, greedy=True), saved.act(obs, greedy=True))
    with pytest.raises(ValueError, match=r"state has no tensor 'scale\.count'"):
        loaded.load({name: t for name, t in saved.state().items() if name != "scale.count"})


@pytest.mark.parametrize("advantage", ["counterfactual", "value"])
def test_probabilities_kept_from_acting_are_those_computed_anew(advantage: str) -> None:
    acting, given = (make(2, numbers={"advantage": advantage}) for _ in range(2))
    source = torch.Generator().manual_seed(0)
    none = torch.zeros(ENVS, dtype=torch.bool)
    obs = torch.randn(ENVS, 2, OBS_WIDTH, generator=source)
    for _ in range(STEPS):
        after = torch.randn(ENVS, 2, OBS_WIDTH, generator=source)
        actions = acting.act(obs)
        reward = torch.randn(ENVS, 2, generator=source)
        acting.observe(Transitions(obs, actions, reward, after, none), none)
        # A copy is not what the learner acted on, so that nothing is known of it.
        given.observe(Transitions(obs.clone(), actions, reward, after, none), none)
        obs = after
    acting.seed_draws(1)
    given.seed_draws(1)
    kept, computed = acting._rollout(), given._rollout()
    for got, expected in zip(kept, computed, strict=True):
        close(got, expected)
    assert acting._buffer.steps().log_probs is not None
    assert given._buffer.steps().log_probs is None


def test_a_schedule_sets_discount_and_entropy_weight() -> None:
    learner, fixed = make(2), make(2, numbers={"gamma": 0.5, "entropy_weight": 0.3})
    learner.follow(Scheduled(gamma=0.5, entropy_weight=0.3))
    results = []
    for one in (learner, fixed):
        collect(one, 2, 0)
        one.learn()
        results.append(one.state())
    assert all(torch.equal(results[0][name], results[1][name]) for name in results[0])
    unchanged = make(2)
    collect(unchanged, 2, 0)
    unchanged.learn()
    assert any(not torch.equal(unchanged.state()[name], results[0][name]) for name in results[0])
