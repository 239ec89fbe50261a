"""Targets and losses against numbers worked out by hand."""

import math

import pytest
import torch
from torch import Tensor

from innerattn.learn import losses
from innerattn.nn import Attended

HALF = math.log(0.5)


@pytest.mark.parametrize(
    ("target", "expected"),
    [
        (losses.consistent_target, [1.0 + 0.9 * (2.0 - 0.1), 1.0]),
        (losses.maac_target, [1.0 + 0.9 * 2.0 - 0.1, 1.0 - 0.1]),
    ],
)
def test_targets(target, expected: list[float]) -> None:
    discount = torch.tensor([0.9, 0.0])  # the second episode terminated
    ones = torch.ones(1, 2)
    got = target(ones, 2.0 * ones, 0.1 * ones, discount)
    torch.testing.assert_close(got, torch.tensor([expected]))


def test_critic_loss_is_a_mean_over_the_batch_and_a_sum_over_robots() -> None:
    q = torch.tensor([[1.0, 2.0], [0.0, 0.0]])
    target = torch.tensor([[0.0, 4.0], [1.0, 0.0]])
    assert losses.critic_loss(q, target).item() == pytest.approx((1 + 4) / 2 + 1 / 2)


def attended(scores: Tensor | None, visible: Tensor) -> Attended:
    return Attended(torch.zeros(1), torch.zeros(1), scores, visible)


def test_logit_regularisation_counts_visible_pairs() -> None:
    scores = torch.tensor([[[[9.0, 2.0], [4.0, 9.0]]]])
    visible = torch.tensor([[[False, True], [True, False]]])

    def value(given: Attended, weight: float = 0.5) -> float:
        return float(losses.attention_logit_regularisation(given, weight))

    assert value(attended(scores, visible)) == 0.5 * (4 + 16)
    assert value(attended(scores, visible), weight=0.0) == 0
    assert value(attended(scores, visible & False)) == 0
    assert value(attended(scores[..., :1, :1], visible[:, :1, :1])) == 0  # a robot alone
    assert value(attended(None, visible)) == 0
    assert losses.attention_logit_regularisation(None, 0.5) == 0


def test_policy_losses() -> None:
    log_prob = torch.tensor([[[HALF], [HALF]]])
    q = torch.tensor([[[3.0], [1.0]]])
    first = torch.tensor([[0]])
    expected = losses.expected_policy_loss(log_prob, q, first, temperature=0.2)
    assert expected.item() == pytest.approx(0.2 * HALF - 2.0)
    sampled = losses.sampled_policy_loss(log_prob, q, first, temperature=0.2)
    assert sampled.item() == pytest.approx(HALF * (0.2 * HALF - (3.0 - 2.0)))


def test_both_policy_losses_have_the_same_gradient_on_average() -> None:
    source = torch.Generator().manual_seed(0)
    q = torch.randn(1, 4, 1, generator=source, dtype=torch.float64)
    start = torch.randn(1, 4, 1, generator=source, dtype=torch.float64)
    gradients = []
    for form in ("expected", "sampled"):
        logits = start.clone().requires_grad_()
        log_prob = logits.log_softmax(1)
        if form == "expected":
            loss = losses.expected_policy_loss(log_prob, q, torch.zeros(1, 1).long(), 0.3)
        else:  # over all actions, each weighed by its probability
            loss = sum(
                log_prob[0, a, 0].exp().detach()
                * losses.sampled_policy_loss(log_prob, q, torch.full((1, 1), a), 0.3)
                for a in range(4)
            )
        gradients += torch.autograd.grad(loss, [logits])
    torch.testing.assert_close(gradients[0], gradients[1], rtol=1e-12, atol=1e-12)
