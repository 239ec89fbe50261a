"""Policies over continuous actions, against torch's own distributions and plain sampling."""

import math

import pytest
import torch
from torch import Tensor
from torch.distributions import Independent, Normal, TransformedDistribution
from torch.distributions.transforms import TanhTransform

from innerattn.nn import DiscreteActions, SquashedActions
from innerattn.nn.actions import (
    FIRST_LOG_STD,
    LOG_STD_RANGE,
    log_slope_of_tanh,
    mean_and_log_std,
)

R, B, W = 3, 50, 2
VECTORS = SquashedActions(W)


def generator(seed: int = 0) -> torch.Generator:
    return torch.Generator().manual_seed(seed)


def some_outputs(seed: int = 0, spread: float = 1.5) -> Tensor:
    return spread * torch.randn(R, 2 * W, B, generator=generator(seed), dtype=torch.float64)


def reference(outputs: Tensor) -> TransformedDistribution:
    """The same policies by torch.distributions, over (R, B, W)."""
    mean, raw = outputs[:, :W].mT, outputs[:, W:].mT
    low, high = LOG_STD_RANGE
    shift = -math.log((high - low) / (FIRST_LOG_STD - low) - 1.0)
    std = (low + (high - low) / (1.0 + (-raw - shift).exp())).exp()
    return TransformedDistribution(Independent(Normal(mean, std), 1), [TanhTransform()])


def test_log_densities_and_their_gradients_are_those_of_torch() -> None:
    outputs = some_outputs().requires_grad_()
    actions = VECTORS.draw(outputs, generator(1))
    assert actions.dtype == torch.float32
    found = VECTORS.log_prob(outputs, actions)
    expected = reference(outputs).log_prob(actions.double())
    torch.testing.assert_close(found, expected, rtol=1e-9, atol=1e-9)
    (gradient,) = torch.autograd.grad(found.sum(), outputs)
    (wanted,) = torch.autograd.grad(expected.sum(), outputs)
    torch.testing.assert_close(gradient, wanted, rtol=1e-8, atol=1e-8)


def test_the_slope_of_tanh_is_exact_far_out_too() -> None:
    u = torch.tensor([0.0, 0.3, -2.0, 5.0, -5.0], dtype=torch.float64)
    torch.testing.assert_close(log_slope_of_tanh(u), (1.0 - u.tanh().square()).log())
    far = torch.tensor([-200.0, 50.0, 1e4])
    torch.testing.assert_close(log_slope_of_tanh(far), 2 * math.log(2.0) - 2 * far.abs())


def test_the_ends_of_the_range_have_a_finite_density() -> None:
    outputs = torch.tensor([40.0, -40.0, 0.0, 0.0]).view(1, 4, 1).requires_grad_()
    actions = VECTORS.draw(outputs, generator())
    assert actions.flatten().tolist() == [1.0, -1.0]
    log_prob, entropy = VECTORS.scored(outputs, actions)
    (gradient,) = torch.autograd.grad(log_prob.sum() + entropy.sum(), outputs)
    assert all(bool(one.isfinite().all()) for one in (log_prob, entropy, gradient))


def test_drawn_actions_follow_the_density() -> None:
    outputs = torch.tensor([0.4, -0.2, 0.3, -1.0], dtype=torch.float64).view(1, 4, 1)
    drawn = VECTORS.draw(outputs.expand(1, 4, 200_000), generator(3))[0].double()
    edges = torch.linspace(-1.0, 1.0, 9, dtype=torch.float64)
    mean, log_std = mean_and_log_std(outputs)
    for axis in range(W):
        normal = Normal(mean[0, axis, 0], log_std[0, axis, 0].exp())
        below = normal.cdf(edges.clamp(-1 + 1e-12, 1 - 1e-12).atanh())
        expected = len(drawn[:, axis]) * below.diff()
        counts = torch.histogram(drawn[:, axis].contiguous(), edges).hist
        assert ((counts - expected).square() / expected).sum() < 24.3  # 0.1 %, 7 d.o.f.


def test_the_entropy_is_the_mean_of_minus_the_log_density() -> None:
    outputs = some_outputs(5)
    many = outputs.unsqueeze(3).expand(-1, -1, -1, 20_000).flatten(2)
    actions = reference(many).sample()
    sampled = -reference(many).log_prob(actions).view(R, B, -1).mean(dim=2)
    found = VECTORS.scored(outputs, actions[:, :B].float())[1]
    torch.testing.assert_close(found, sampled, rtol=0.0, atol=0.06)
    assert (found < W * math.log(2.0)).all()


def test_training_begins_with_wide_policies_and_their_width_is_bounded() -> None:
    mean, log_std = mean_and_log_std(torch.zeros(1, 4, 1))
    assert mean.tolist() == [[[0.0], [0.0]]]
    torch.testing.assert_close(log_std, torch.full((1, 2, 1), FIRST_LOG_STD))
    for far, end in ((-1e4, LOG_STD_RANGE[0]), (1e4, LOG_STD_RANGE[1])):
        assert mean_and_log_std(torch.full((1, 4, 1), far))[1].unique().item() == pytest.approx(end)


def test_the_likeliest_action_is_the_squashed_mean() -> None:
    outputs = some_outputs(7)
    found = VECTORS.likeliest(outputs)
    torch.testing.assert_close(found, outputs[:, :W].tanh().mT.float())
    discrete = DiscreteActions(2 * W)
    assert torch.equal(discrete.likeliest(outputs), outputs.argmax(dim=1))


@pytest.mark.parametrize(
    ("actions", "given", "allowed"),
    [
        (DiscreteActions(5), torch.tensor([0, 5]), "0..=4"),
        (DiscreteActions(5), torch.tensor([-1, 4]), "0..=4"),
        (VECTORS, torch.tensor([0.5, 1.001]), "-1..=1"),
        (VECTORS, torch.tensor([0.5, math.nan]), "-1..=1"),
    ],
)
def test_what_is_no_action_is_refused(actions, given: Tensor, allowed: str) -> None:
    with pytest.raises(ValueError, match=allowed):
        actions.refuse_unknown(given)
    actions.refuse_unknown(given.clamp(0, 1).nan_to_num())
