"""What is done with gradients before a step."""

import pytest
import torch
from torch import Tensor

from innerattn.config import NetworkConfig, PPOConfig, TDConfig
from innerattn.learn import PPO, TD, Team, Transitions
from innerattn.learn.adam import AdamStepper, Forward
from innerattn.learn.gradients import average_over_robots, clip_norm, clip_norm_by_robot
from innerattn.nn import Critic, InnerAttention, robots_of_each_kind, share_by_kind


@pytest.mark.parametrize("count", [1, 6, 8, 9, 20, 70])
def test_each_robot_is_clipped_alone_whatever_the_number_of_parameters(count: int) -> None:
    source = torch.Generator().manual_seed(count)
    gradients = {
        str(k): torch.randn(3, 2 + k % 3, 4, generator=source, dtype=torch.float64)
        for k in range(count)
    }
    for gradient in gradients.values():
        gradient[1] *= 1e-3
    whole = [torch.cat([g[robot].flatten() for g in gradients.values()]) for robot in range(3)]
    expected = torch.stack([row.square().sum().sqrt() for row in whole])
    norms = clip_norm_by_robot(gradients, 1.0)
    torch.testing.assert_close(norms, expected)
    after = [torch.cat([g[robot].flatten() for g in gradients.values()]) for robot in range(3)]
    assert expected[1] < 1.0 < expected[0]
    for robot, (before, row) in enumerate(zip(whole, after, strict=True)):
        share = 1.0 if robot == 1 else 1.0 / expected[robot]
        torch.testing.assert_close(row, share * before, rtol=1e-5, atol=0.0)


def test_the_whole_is_clipped_to_a_common_norm() -> None:
    gradients = {"a": torch.tensor([[3.0, 0.0]]), "b": torch.tensor([4.0])}
    assert clip_norm(gradients, 10.0).item() == 5.0
    torch.testing.assert_close(gradients["a"], torch.tensor([[3.0, 0.0]]))
    assert clip_norm(gradients, 2.5).item() == 5.0
    torch.testing.assert_close(gradients["a"], torch.tensor([[1.5, 0.0]]))
    torch.testing.assert_close(gradients["b"], torch.tensor([2.0]))


def test_by_default_only_what_all_robots_share_is_averaged() -> None:
    names = ("attention.key", "hidden.parametrizations.weight.original", "attention.value_bias")
    gradients = {name: torch.full((4, 3), 8.0) for name in names}
    average_over_robots(gradients, 4, None)
    assert [gradients[name].unique().item() for name in names] == [2.0, 8.0, 2.0]


KINDS = ("food", "medical", "food", "navigation", "medical", "food")
ROBOTS, OBS_WIDTH, ACTIONS, BATCH = len(KINDS), 5, 3, 7


def critic() -> Critic:
    source = torch.Generator().manual_seed(0)
    return Critic(ROBOTS, OBS_WIDTH, ACTIONS, InnerAttention(8, 2, source), source).double()


def test_gradients_by_kind_are_the_means_of_those_of_copies() -> None:
    """Against a critic whose robots hold copies of their kind's weights, robot by robot."""
    copies, shared = critic(), critic()
    share_by_kind(shared, KINDS)
    first = [KINDS.index(kind) for kind in KINDS]
    source = torch.Generator().manual_seed(1)
    obs = torch.randn(ROBOTS, BATCH, OBS_WIDTH, generator=source, dtype=torch.float64)
    actions = torch.randint(ACTIONS, (ROBOTS, BATCH), generator=source)

    def loss_of(forward: Forward) -> tuple[Tensor, None]:
        return forward(obs, actions).q.square().mean(2).sum(), None

    with torch.no_grad():
        for name, value in copies.named_parameters():
            if not name.startswith("attention."):
                value.copy_(value[first].clone())
    found, _ = AdamStepper(shared).gradients(loss_of)
    average_over_robots(found, ROBOTS, robots_of_each_kind(KINDS))
    expected, _ = AdamStepper(copies).gradients(loss_of)
    for name, of_robots in expected.items():
        if name.startswith("attention."):
            torch.testing.assert_close(found.pop(name), of_robots / ROBOTS)
            continue
        layer, last = name.rsplit(".", 1)
        of_kinds = found.pop(f"{layer}.parametrizations.{last}.original")
        for kind, gradient in zip(("food", "medical", "navigation"), of_kinds, strict=True):
            members = [of_robots[i] for i in range(ROBOTS) if KINDS[i] == kind]
            torch.testing.assert_close(gradient, sum(members) / len(members))
    assert not found


@pytest.mark.parametrize("learner", [TD, PPO])
def test_a_learner_averages_by_kind_where_it_is_asked_to(learner: type[TD] | type[PPO]) -> None:
    """The first update's gradients, unclipped, against those of the sum."""
    numbers = {"critic_grad_clip": 1e9, "actor_grad_clip": 1e9, "learning_rate": 1e-15}
    config = TDConfig(**numbers) if learner is TD else PPOConfig(rollout_steps=1, **numbers)
    source = torch.Generator().manual_seed(2)
    obs = torch.randn(2, BATCH, ROBOTS, OBS_WIDTH, generator=source)
    actions = torch.randint(ACTIONS, (BATCH, ROBOTS), generator=source)
    reward = torch.randn(BATCH, ROBOTS, generator=source)
    going_on = torch.zeros(BATCH, dtype=torch.bool)
    batch = Transitions(obs[0], actions, reward, obs[1], going_on)

    def gradients(shared_gradients: str) -> dict[str, Tensor]:
        network = NetworkConfig(
            hidden_width=8,
            attention_heads=2,
            parameter_sharing="kind",
            shared_gradients=shared_gradients,
        )
        team = Team(ROBOTS, OBS_WIDTH, ACTIONS, kinds=KINDS)
        cpu, double = torch.device("cpu"), torch.float64
        made = learner(team, network, config, seed=1, device=cpu, dtype=double)
        made.observe(batch, going_on)
        if isinstance(made, TD):
            made.update(batch)
        else:
            made.learn()
        networks = {"actor": made.actor, "critic": made.critic}
        return {
            f"{name}.{key}": parameter.grad
            for name, module in networks.items()
            for key, parameter in module.named_parameters()
        }

    sums, means = gradients("sum"), gradients("mean")
    counts = torch.tensor([3.0, 2.0, 1.0], dtype=torch.float64)
    for name, gradient in means.items():
        assert gradient.any(), name
        shared_by_all = name.startswith("critic.attention.")
        divisor = 1.0 if shared_by_all else counts.view(-1, *[1] * (gradient.dim() - 1))
        torch.testing.assert_close(gradient, sums[name] / divisor, rtol=1e-8, atol=1e-10)
