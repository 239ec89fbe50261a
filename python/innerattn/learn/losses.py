"""Targets and losses of the learners, as pure functions of tensors.

The batch is the last dimension, (R, A, B) or (R, B). Losses are means over the batch and sums over
robots, so that a robot's own parameters get the gradient of its own loss, whatever the size of the
team. Sources: Iqbal & Sha 2019, sections 3.1-3.3, and their code ("MAAC"); Schulman et al. 2017.
"""

from __future__ import annotations

import torch
from torch import Tensor

from innerattn.nn import Attended


def gather_actions(x: Tensor, actions: Tensor) -> Tensor:
    """Pick the (R, B) entries of (R, A, B) that belong to actions (R, B) int64."""
    return x.gather(1, actions.unsqueeze(1)).squeeze(1)


def consistent_target(
    reward: Tensor, value: Tensor, entropy_term: Tensor, discount: Tensor
) -> Tensor:
    """The soft Bellman target y = r + discount (Q' - tau log pi').

    Args:
        reward: (R, B).
        value: (R, B) target critic's value of the next action.
        entropy_term: (R, B) tau log pi of the next action; tau is the temperature.
        discount: (B,) gamma, or 0 where the episode terminated.
    """
    return reward + discount * (value - entropy_term)


def maac_target(reward: Tensor, value: Tensor, entropy_term: Tensor, discount: Tensor) -> Tensor:
    """The target of MAAC's code: y = r + discount Q' - tau log pi', entropy outside the discount.

    Arguments as in `consistent_target`.
    """
    return reward + discount * value - entropy_term


def critic_loss(q_taken: Tensor, target: Tensor) -> Tensor:
    """Squared error of the values (R, B) of the actions taken against the target (R, B)."""
    return (q_taken - target).square().mean(dim=1).sum()


def attention_logit_regularisation(attended: Attended | None, weight: float) -> Tensor | float:
    """The weighted mean of (q_i . k_j)^2 over batch and teammates, summed over heads and robots.

    Args:
        attended: What the critic's attention made of a batch.
        weight: Weight in the critic's loss.

    Returns:
        (); 0 where the critic scores no teammate, or the weight is 0.
    """
    if not weight or attended is None or attended.scores is None:
        return 0.0
    batch, _, robots, _ = attended.scores.shape
    squares = attended.scores.square() * attended.visible.unsqueeze(1)
    return weight * (squares.sum() / (batch * max(robots - 1, 1)))


def expected_policy_loss(
    log_prob: Tensor, q: Tensor, actions: Tensor, temperature: Tensor | float
) -> Tensor:
    """sum_a pi(a) (tau log pi(a) - Q(a)): the exact expectation over the own action.

    Args:
        log_prob: (R, A, B) log-probabilities of the current policy.
        q: (R, A, B) values of every own action, without gradient.
        actions: (R, B) int64 actions drawn from the policy; this form does not use them.
        temperature: tau.
    """
    del actions
    return (log_prob.exp() * (temperature * log_prob - q)).sum(dim=1).mean(dim=1).sum()


def sampled_policy_loss(
    log_prob: Tensor, q: Tensor, actions: Tensor, temperature: Tensor | float
) -> Tensor:
    """The loss log pi(a) [tau log pi(a) - (Q(a) - b)] for the drawn a, with a constant bracket.

    b = sum_a pi(a) Q(a) is the counterfactual baseline. Arguments as in `expected_policy_loss`.
    """
    drawn = gather_actions(log_prob, actions)
    with torch.no_grad():
        advantage = gather_actions(q, actions) - (log_prob.exp() * q).sum(dim=1)
        cost = temperature * drawn - advantage
    return (drawn * cost).mean(dim=1).sum()


def clipped_policy_loss(log_prob: Tensor, before: Tensor, advantage: Tensor, clip: float) -> Tensor:
    """-min(ratio A, clip(ratio, 1 - c, 1 + c) A): the clipped surrogate (Schulman et al. 2017).

    Args:
        log_prob: (R, B) of the actions taken, under the policy that is trained.
        before: (R, B) the same under the policy that acted.
        advantage: (R, B).
        clip: c.
    """
    ratio = (log_prob - before).exp()
    bounded = ratio.clamp(1.0 - clip, 1.0 + clip)
    return -torch.minimum(ratio * advantage, bounded * advantage).mean(dim=1).sum()


def entropy(log_prob: Tensor) -> Tensor:
    """(R, B) entropies, nats, of policies with log-probabilities (R, A, B)."""
    return -(log_prob.exp() * log_prob).sum(dim=1)
