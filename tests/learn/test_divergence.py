"""Numbers that are not finite are named, and nothing is learnt from them."""

import math
from collections.abc import Callable
from typing import Any

import pytest
import torch
from torch import Tensor

from innerattn.config import NetworkConfig, PPOConfig, TDConfig
from innerattn.learn import PPO, TD, Team, Transitions
from innerattn.learn.divergence import DivergenceError, refuse_not_finite_reward
from innerattn.learn.rollout import Rollout

TEAM = Team(3, 4, 5)
ROBOTS = ("food_0", "navigation_0", "medical_0")
CPU = torch.device("cpu")


def td(compiled: bool) -> TD:
    network = NetworkConfig(hidden_width=8, attention_heads=2)
    learner = TD(TEAM, network, TDConfig(batch_size=8, replay_capacity=64), seed=0, device=CPU)
    if compiled:
        learner.compile(backend="aot_eager")
    return learner


def ppo(compiled: bool) -> PPO:
    network = NetworkConfig(hidden_width=8, attention_heads=2)
    learner = PPO(TEAM, network, PPOConfig(), seed=0, device=CPU)
    if compiled:
        learner.compile(backend="aot_eager")
    return learner


def transitions(size: int = 8) -> Transitions:
    source = torch.Generator().manual_seed(1)
    return Transitions(
        torch.randn(size, 3, 4, generator=source),
        torch.randint(5, (size, 3), generator=source),
        torch.randn(size, 3, generator=source),
        torch.randn(size, 3, 4, generator=source),
        torch.zeros(size, dtype=torch.bool),
    )


def rollout() -> Rollout:
    source = torch.Generator().manual_seed(1)
    rows = [torch.randn(3, 16, generator=source) for _ in range(2)]
    actions = torch.randint(5, (3, 16), generator=source)
    log_prob = torch.full((3, 16), -math.log(5.0))
    return Rollout(torch.randn(3, 16, 4, generator=source), actions, log_prob, *rows)


BATCHES: dict[str, Callable[[], Any]] = {"td": transitions, "ppo": rollout}


def alike(left: dict[str, Tensor], right: dict[str, Tensor]) -> bool:
    return all(torch.equal(left[name], right[name]) for name in left)


@pytest.mark.long
@pytest.mark.parametrize("bad", [math.nan, -math.inf])
@pytest.mark.parametrize("compiled", [False, True])
def test_td_learns_nothing_from_a_broken_reward(compiled: bool, bad: float) -> None:
    learner, batch = td(compiled), transitions()
    for _ in range(2):
        learner.update(batch)
    before = learner.state()
    batch.reward[3, 1] = bad
    with pytest.raises(DivergenceError) as caught:
        learner.update(batch)
    assert caught.value.robot == 1
    text = caught.value.text(ROBOTS)
    assert text.startswith("losses.critic_loss = ")
    assert ": must be finite; first in the gradient of critic." in text
    assert text.endswith(" of robot navigation_0")
    after = learner.state()
    assert alike(before, after)
    assert after["updates"] == 2
    learner.update(transitions())  # it goes on
    assert learner.updates == 3


@pytest.mark.long
@pytest.mark.parametrize("compiled", [False, True])
def test_ppo_learns_nothing_from_a_broken_advantage(compiled: bool) -> None:
    learner, rows = ppo(compiled), rollout()
    learner.update(rows)
    rows.advantage[2, 5] = math.nan
    before = learner.state()
    with pytest.raises(DivergenceError) as caught:
        learner.update(rows)
    assert caught.value.text(ROBOTS).endswith(
        "first in the gradient of actor.first.weight of robot medical_0"
    )
    assert alike(before, learner.state())


def overflow(learner: TD | PPO) -> None:
    """Let the policies overflow; all their weights are finite, and the critic works."""
    *_, last = (value for name, value in learner.actor.named_parameters() if "weight" in name)
    with torch.no_grad():
        last.fill_(3e38)


@pytest.mark.parametrize(
    ("method", "compiled"),
    [
        ("td", False),
        ("ppo", False),
        pytest.param("ppo", True, marks=pytest.mark.long),
        pytest.param("td", True, marks=pytest.mark.long),
    ],
)
def test_an_actor_that_fails_undoes_the_step_of_the_critic(
    method: str, compiled: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    learner, batch = (td if method == "td" else ppo)(compiled), BATCHES[method]()
    learner.update(batch)
    overflow(learner)
    before = learner.state()
    with monkeypatch.context() as patched:
        patched.setattr("innerattn.learn.undo.Undo.restore", lambda _: None)
        with pytest.raises(DivergenceError):
            learner.update(batch)
    stepped = {
        name for name, value in learner.state().items() if not torch.equal(value, before[name])
    }
    assert any(name.startswith("critic.") for name in stepped)  # else nothing is shown below
    learner.load(before)
    with pytest.raises(DivergenceError) as caught:
        learner.update(batch)
    assert "first in the gradient of actor." in caught.value.text(ROBOTS)
    assert alike(before, learner.state())


def test_what_diverged_is_skipped_and_counted_where_asked_for() -> None:
    learner = td(compiled=False)
    learner.skips_divergence = True
    learner.observe(transitions(48), torch.zeros(48, dtype=torch.bool))
    assert learner.learn() is None
    learner.replay.ring.columns["rows"][0, -4] = math.inf  # a reward
    learner._pending_env_steps = 20 * 50
    found = learner.learn()
    assert found is not None
    skipped = found.pop("skipped_updates")
    assert 0 < skipped < 20
    assert learner.updates == 20 - skipped
    assert all(math.isfinite(value) for value in found.values())


def test_a_reward_is_named_by_its_robot() -> None:
    reward = torch.zeros(4, 3)
    refuse_not_finite_reward(reward)
    reward[2, 1] = -math.inf
    with pytest.raises(DivergenceError) as caught:
        refuse_not_finite_reward(reward)
    assert caught.value.text(ROBOTS) == "reward = -inf of robot navigation_0: must be finite"
