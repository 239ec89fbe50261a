"""What each network may and may not depend on, and how actions are drawn."""

import pytest
import torch

from innerattn.nn import (
    Actor,
    CentralCritic,
    Critic,
    InnerAttention,
    PerRobotLinear,
    action_noise,
    sample_actions,
    swap_robots,
)

R, B, D, A, W = 3, 6, 4, 5, 8


def generator(seed: int = 0) -> torch.Generator:
    return torch.Generator().manual_seed(seed)


def make_critic() -> Critic:
    source = generator()
    return Critic(R, D, A, InnerAttention(W, 2, source), source).double()


def test_linear_layers_of_robots_are_apart() -> None:
    layer = PerRobotLinear(R, D, A, generator()).double()
    x = torch.randn(R, B, D, generator=generator(1), dtype=torch.float64)
    expected = torch.stack([x[i] @ layer.weight[i].T + layer.bias[i] for i in range(R)])
    torch.testing.assert_close(layer(x), expected)
    torch.testing.assert_close(layer.batch_last(x), expected.transpose(1, 2))
    torch.testing.assert_close(layer.side_by_side(x[..., :1], x[..., 1:]), expected)


def test_swapped_robots_act_as_each_other() -> None:
    actor, swapped = (Actor(R, D, A, W, generator()).double() for _ in range(2))
    swap_robots(swapped, 2, 0)
    x = torch.randn(R, B, D, generator=generator(1), dtype=torch.float64)
    with torch.no_grad():
        torch.testing.assert_close(swapped(x), actor(x[[2, 1, 0]])[[2, 1, 0]])
    assert not torch.equal(swapped(x), actor(x))


def test_a_swap_leaves_what_robots_share_as_it_is() -> None:
    shared, swapped = make_critic(), make_critic()
    swap_robots(swapped, 0, 1)
    same = {
        name
        for name, weights in swapped.state_dict().items()
        if torch.equal(weights, shared.state_dict()[name])
    }
    assert same == {name for name in shared.state_dict() if name.startswith("attention.")} != set()
    central = CentralCritic(R, D, A, W, generator())
    before = {name: weights.clone() for name, weights in central.state_dict().items()}
    swap_robots(central, 0, 1)
    for name, weights in central.state_dict().items():
        assert torch.equal(weights, before[name])


def test_initial_weights_fill_the_usual_range_and_leave_the_global_generator_alone() -> None:
    before = torch.random.get_rng_state()
    layer = PerRobotLinear(4, 25, 200, generator())
    assert torch.equal(torch.random.get_rng_state(), before)
    for parameter in (layer.weight, layer.bias):
        assert 0.19 < parameter.abs().max() <= 0.2
        assert parameter.mean().abs() < 0.02


def test_own_values_ignore_the_own_action_and_heed_those_of_teammates() -> None:
    critic = make_critic()
    obs = torch.randn(R, B, D, generator=generator(1), dtype=torch.float64)
    actions = torch.zeros(R, B, dtype=torch.int64)
    before = critic(obs, actions).q
    assert before.shape == (R, A, B)
    actions[1] = 3
    after = critic(obs, actions).q
    assert torch.equal(after[1], before[1])
    for i in (0, 2):
        assert (after[i] - before[i]).abs().min() > 1e-6


def test_policies_see_their_own_observation_only() -> None:
    actor = Actor(R, D, A, W, generator())
    obs = torch.randn(R, B, D, generator=generator(1))
    before = actor(obs)
    assert before.shape == (R, A, B)
    obs[1] += 1.0
    after = actor(obs)
    assert torch.equal(after[0], before[0])
    assert (after[1] - before[1]).abs().max() > 1e-3


def test_drawn_actions_have_the_given_probabilities() -> None:
    probabilities = torch.tensor([0.5, 0.3, 0.15, 0.05, 0.0])
    logits = probabilities.log().view(1, A, 1).expand(1, A, 100_000).contiguous()
    counts = torch.bincount(
        sample_actions(logits, action_noise(logits.shape, generator(4)))[0], minlength=A
    )
    assert counts[4] == 0
    expected = 100_000 * probabilities[:4]
    assert ((counts[:4] - expected) ** 2 / expected).sum() < 16.3  # 0.1 % point, 3 d.o.f.


def test_the_extreme_draws_of_the_generator_choose_no_impossible_action(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # float32 draws are multiples of 2^-24 in [0, 1): the ends are where a Gumbel could be infinite.
    logits = torch.tensor([[[0.0, 0.0], [-200.0, -200.0]]])
    ends = torch.tensor([[[0.0, 1 - 2**-24], [1 - 2**-24, 0.0]]])
    monkeypatch.setattr(torch.Tensor, "uniform_", lambda self, **_: self.copy_(ends))
    noise = action_noise(logits.shape, generator())
    assert sample_actions(logits, noise).tolist() == [[0, 0]]
