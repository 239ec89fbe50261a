"""What an actor's outputs mean: chances of discrete actions, or a distribution over vectors.

The discrete form is the softmax of logits. The continuous one is a squashed Gaussian (Haarnoja et
al. 2018, appendix C): a = tanh(u) with u ~ N(mean, std), independent on each axis.
"""

from __future__ import annotations

import math
from typing import Protocol

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from innerattn.nn.actor import action_noise, sample_actions

LOG_STD_RANGE = (-3.0, 0.5)
"""Lowest and highest logarithm of the standard deviation before squashing."""
FIRST_LOG_STD = -0.5
"""Its value where an actor's output is 0, as it nearly is at the start of training."""
LOG_STD_SHIFT = math.log((FIRST_LOG_STD - LOG_STD_RANGE[0]) / (LOG_STD_RANGE[1] - FIRST_LOG_STD))
_NODES = 8
_LN_2, _LN_2_PI = math.log(2.0), math.log(2.0 * math.pi)


class Actions(Protocol):
    """One kind of actions, and the policies over them. R robots, B observations, O outputs.

    Attributes:
        outputs: O, numbers that an actor gives for each robot.
        shape: What an action adds to the shape of actions: () or (W,).
        dtype: Of actions.
    """

    outputs: int
    shape: tuple[int, ...]
    dtype: torch.dtype

    def draw(self, outputs: Tensor, generator: torch.Generator) -> Tensor:
        """Actions ``(R, B, *shape)`` drawn from the policies with outputs (R, O, B)."""

    def likeliest(self, outputs: Tensor) -> Tensor:
        """The actions ``(R, B, *shape)`` that policies take when they draw none."""

    def log_prob(self, outputs: Tensor, actions: Tensor) -> Tensor:
        """(R, B) logarithm of the chance, or of the density, of actions ``(R, B, *shape)``."""

    def scored(self, outputs: Tensor, actions: Tensor) -> tuple[Tensor, Tensor]:
        """`log_prob`, and the entropy of the policies (R, B) [nats]."""

    def refuse_unknown(self, actions: Tensor) -> None:
        """Refuse what is no action.

        Raises:
            ValueError: A value is out of range; the message says which range there is.
        """


class DiscreteActions:
    """Actions 0 to A - 1, with chances softmax(outputs); see `Actions`."""

    shape: tuple[int, ...] = ()
    dtype = torch.int64

    def __init__(self, num_actions: int) -> None:
        """Know ``num_actions``, A."""
        self.outputs = num_actions

    def draw(self, outputs: Tensor, generator: torch.Generator) -> Tensor:
        """See `Actions.draw`."""
        return sample_actions(outputs, action_noise(outputs.shape, generator, outputs.dtype))

    def likeliest(self, outputs: Tensor) -> Tensor:
        """The action of the largest chance; see `Actions.likeliest`."""
        return outputs.argmax(dim=1)

    def log_prob(self, outputs: Tensor, actions: Tensor) -> Tensor:
        """See `Actions.log_prob`."""
        return self.scored(outputs, actions)[0]

    def scored(self, outputs: Tensor, actions: Tensor) -> tuple[Tensor, Tensor]:
        """See `Actions.scored`; the entropy is -sum_a pi(a) log pi(a)."""
        log_prob = outputs.log_softmax(dim=1)
        taken = log_prob.gather(1, actions.unsqueeze(1)).squeeze(1)
        return taken, -(log_prob.exp() * log_prob).sum(dim=1)

    def refuse_unknown(self, actions: Tensor) -> None:
        """See `Actions.refuse_unknown`."""
        most = self.outputs - 1
        if actions.numel() and (int(actions.min()) < 0 or int(actions.max()) > most):
            raise ValueError(f"'actions': must be in 0..={most}")


class SquashedActions:
    """Vectors of W numbers in [-1, 1], a = tanh(u) with u ~ N(mean, std); see `Actions`.

    The first W outputs are the means; `mean_and_log_std` makes standard deviations of the others.
    """

    shape: tuple[int, ...]
    dtype = torch.float32

    def __init__(self, width: int) -> None:
        """Know ``width``, W."""
        self.outputs, self.shape = 2 * width, (width,)
        places, weights = np.polynomial.hermite_e.hermegauss(_NODES)
        self._nodes = tuple(zip(places.tolist(), (weights / weights.sum()).tolist(), strict=True))

    def draw(self, outputs: Tensor, generator: torch.Generator) -> Tensor:
        """See `Actions.draw`."""
        mean, log_std = mean_and_log_std(outputs.detach())
        noise = torch.empty(mean.shape, dtype=mean.dtype, device=generator.device)
        drawn = mean + log_std.exp() * noise.normal_(generator=generator)
        return drawn.tanh().transpose(1, 2).to(self.dtype)

    def likeliest(self, outputs: Tensor) -> Tensor:
        """tanh(mean), the median of every axis; see `Actions.likeliest`."""
        return mean_and_log_std(outputs)[0].tanh().transpose(1, 2).to(self.dtype)

    def log_prob(self, outputs: Tensor, actions: Tensor) -> Tensor:
        """The sum over axes of log N(u) - log(1 - tanh(u)^2), with u = artanh(a).

        An action of -1 or 1, to which tanh is rounded, counts as the float32 number next to it.
        See `Actions.log_prob`.
        """
        mean, log_std = mean_and_log_std(outputs)
        most = 1.0 - 0.5 * torch.finfo(torch.float32).eps
        u = actions.to(mean.dtype).transpose(1, 2).clamp(-most, most).atanh()
        away = (u - mean) * (-log_std).exp()
        gaussian = -0.5 * away.square() - log_std - 0.5 * _LN_2_PI
        return (gaussian - log_slope_of_tanh(u)).sum(dim=1)

    def entropy(self, outputs: Tensor) -> Tensor:
        """(R, B) differential entropy of the squashed policy [nats].

        That of the Gaussian plus the expectation of log(1 - tanh(u)^2), summed over axes. The
        expectation is taken by Gauss-Hermite quadrature with 8 nodes: nothing is drawn. The uniform
        policy has the largest entropy there is, W ln 2; there is no smallest.
        """
        mean, log_std = mean_and_log_std(outputs)
        std = log_std.exp()
        entropy = 0.5 + 0.5 * _LN_2_PI + log_std
        for place, weight in self._nodes:
            entropy = entropy + weight * log_slope_of_tanh(mean + place * std)
        return entropy.sum(dim=1)

    def scored(self, outputs: Tensor, actions: Tensor) -> tuple[Tensor, Tensor]:
        """See `Actions.scored`, `log_prob` and `entropy`."""
        return self.log_prob(outputs, actions), self.entropy(outputs)

    def refuse_unknown(self, actions: Tensor) -> None:
        """See `Actions.refuse_unknown`."""
        if not bool((actions.abs() <= 1.0).all()):  # NaN too
            raise ValueError("'actions': must be in -1..=1")


def mean_and_log_std(outputs: Tensor) -> tuple[Tensor, Tensor]:
    """What outputs (R, 2 W, B) say of u: means and log standard deviations, (R, W, B) each.

    The latter are a sigmoid between the ends of `LOG_STD_RANGE`, shifted to `FIRST_LOG_STD` at 0.
    """
    mean, raw = outputs.chunk(2, dim=1)
    low, high = LOG_STD_RANGE
    return mean, low + (high - low) * (raw + LOG_STD_SHIFT).sigmoid()


def log_slope_of_tanh(u: Tensor) -> Tensor:
    """log(1 - tanh(u)^2) = 2 (ln 2 - u - softplus(-2 u)), finite for every finite u."""
    return 2.0 * (_LN_2 - u - functional.softplus(-2.0 * u))
