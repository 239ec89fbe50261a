"""The compiled update: second forms of what torch's compiler cannot follow or would make slow.

Each form here computes what a plain form elsewhere computes, but for rounding; the tests compare
the two. A compiler cannot look into autograd, so `torch.func` gives the gradient. Adam and the
attentions are written out as elementwise operations, which the compiler fuses.

| here                          | plain form                                     |
|-------------------------------|------------------------------------------------|
| `TracedNetwork`               | `innerattn.learn.adam.Network`                 |
| `TracedStepper`               | `innerattn.learn.adam.AdamStepper`             |
| `fused_dot_product_attention` | `innerattn.nn.attention.dot_product_attention` |
| `fused_mean_attention`        | `innerattn.nn.attention.mean_attention`        |
"""

from __future__ import annotations

import copy
from collections.abc import Callable
from typing import Any

import torch
from torch import Tensor, nn
from torch.func import functional_call, grad

from innerattn.learn.adam import (
    BETA_1,
    BETA_2,
    EPSILON,
    AdamStepper,
    Aux,
    Forward,
    Gradients,
    Network,
    joined,
)
from innerattn.nn.attention import (
    Attended,
    InnerAttention,
    UniformAttention,
    visible_teammates,
)
from innerattn.nn.partner import OracleAttention


class CompilerError(RuntimeError):
    """The compiler makes no program of an update; nothing was learnt from it.

    The message is its reason. The next call of `learn` goes on with the same update, uncompiled.
    """


def failed_to_compile(error: BaseException) -> bool:
    """Whether an error of a compiled function is one of torch's compiler."""
    from torch._dynamo.exc import TorchDynamoException

    return isinstance(error, TorchDynamoException)


def first_line(error: BaseException) -> str:
    """The first line of an error's text that says something, or else the name of its type."""
    lines = (text.strip() for text in str(error).splitlines())
    return next((line for line in lines if line and line[-1] != ":"), type(error).__name__)


class TracedNetwork(Network):
    """A network whose numbers are one input of the graph."""

    def __init__(self, plain: Network) -> None:
        """Use the numbers of the plain form, as the same memory."""
        self.module = _with_fused_attention(plain.module)
        self.shapes, self.flat, self.values = plain.shapes, plain.flat, plain.values

    def __call__(self, *inputs: Tensor | None) -> Any:
        """The forward pass."""
        return functional_call(self.module, self.by_name(self.flat), inputs)


class TracedStepper(TracedNetwork):
    """A network and its Adam, written out; its contract is `innerattn.learn.adam.Stepper`."""

    def __init__(self, plain: AdamStepper) -> None:
        """Use numbers and moments of the plain form, as the same memory."""
        super().__init__(plain)
        self._segments, self._mean, self._square = plain.segments, plain.mean, plain.square
        self._weight_decay = plain.weight_decay

    def gradients(self, loss_of: Callable[[Forward], tuple[Tensor, Aux]]) -> tuple[Gradients, Aux]:
        """Gradients of a loss; see `Stepper.gradients`."""
        values = self.by_name(self.flat)
        trained = {name: values[name] for segment in self._segments for name in segment.names}

        def loss_at(trained: dict[str, Tensor]) -> tuple[Tensor, Aux]:
            return loss_of(lambda *inputs: functional_call(self.module, values | trained, inputs))

        found: tuple[Gradients, Aux] = grad(loss_at, has_aux=True)(trained)
        return found

    def step(self, gradients: Gradients, learning_rate: Tensor) -> None:
        """Do one step of Adam; see `Stepper.step`."""
        for segment in self._segments:
            value = self.flat[segment.part]
            gradient = joined(gradients, segment) + self._weight_decay * value
            step = segment.step.add_(1.0)
            mean = self._mean[segment.part].lerp_(gradient, 1.0 - BETA_1)
            square = self._square[segment.part].lerp_(gradient.square(), 1.0 - BETA_2)
            # The corrections for the start: few numbers, so float64 costs nothing.
            mean_share = (1.0 - BETA_1 ** step.double()).to(value.dtype)
            square_share = (1.0 - BETA_2 ** step.double()).sqrt().to(value.dtype)
            denominator = square.sqrt() / square_share + EPSILON
            value.sub_(learning_rate / mean_share * mean / denominator)


def traced(network: Network) -> TracedNetwork:
    """The form of a plain network that a compiled update calls."""
    return TracedStepper(network) if isinstance(network, AdamStepper) else TracedNetwork(network)


def fused_dot_product_attention(
    queries: Tensor, keys: Tensor, values: Tensor, heads: int, available: Tensor | None
) -> Attended:
    """Attention as sums over broadcast products, which a compiler fuses into a few loops.

    Arguments as in `innerattn.nn.attention.dot_product_attention`.
    """
    robots, batch, width = queries.shape
    shape = (robots, batch, heads, width // heads)
    queries, keys, values = queries.view(shape), keys.view(shape), values.view(shape)
    scores = (queries.unsqueeze(1) * keys.unsqueeze(0)).sum(4)  # (R, R, B, H)
    visible = visible_teammates(robots, available, queries.device)
    seen = visible.permute(1, 2, 0).unsqueeze(3)
    lowest = torch.finfo(scores.dtype).min
    weights = (scores * shape[3] ** -0.5).masked_fill(~seen, lowest).softmax(dim=1)
    if robots == 1 or available is not None:
        weights = weights * seen
    mixed = (weights.unsqueeze(4) * values.unsqueeze(0)).sum(1).view(robots, batch, width)
    return Attended(mixed, weights.permute(2, 3, 0, 1), scores.permute(2, 3, 0, 1), visible)


def fused_mean_attention(values: Tensor, heads: int, available: Tensor | None) -> Attended:
    """The mean as a sum over broadcast products.

    Arguments as in `innerattn.nn.attention.mean_attention`.
    """
    robots, batch, _ = values.shape
    visible = visible_teammates(robots, available, values.device)
    weights = visible.to(values.dtype)
    weights = weights / weights.sum(dim=2, keepdim=True).clamp_min(1.0)
    mixed = (weights.permute(1, 2, 0).unsqueeze(3) * values.unsqueeze(0)).sum(1)
    return Attended(
        mixed.contiguous(), weights.unsqueeze(1).expand(batch, heads, -1, -1), None, visible
    )


def _with_fused_attention(module: nn.Module) -> nn.Module:
    """A copy of a network that has the same parameters and, where it attends, the fused forms."""
    same = {id(parameter): parameter for parameter in module.parameters()}
    copied = copy.deepcopy(module, same)
    for layer in copied.modules():
        if isinstance(layer, InnerAttention):
            layer.attend = fused_dot_product_attention
        elif isinstance(layer, UniformAttention | OracleAttention):
            layer.attend = fused_mean_attention
    return copied
