"""Gradient descent of one network: gradient of a loss, clipping, a step of Adam.

The same code runs operation by operation and inside a compiled update. There, `torch.func` gives
the gradient, since a compiler cannot look into autograd, and Adam is written out, since it can fuse
that with what comes before.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import torch
from torch import Tensor, nn
from torch.func import functional_call, grad

Kept = TypeVar("Kept")
Network = Callable[..., Any]
Clip = Callable[[dict[str, Tensor]], Tensor]

_BETA_1, _BETA_2, _EPSILON = 0.9, 0.999, 1e-8  # torch's defaults, the paper's Adam


_UNROLLED = 8
"""Norms that are put together at a time. Torch's compiler (2.15) writes so short a sum out; of a
longer one it makes a loop, which it then fails to fuse with Adam."""


class Descent:
    """A network with its Adam.

    Attributes:
        network: The network.
        adam: Its optimiser; the moments are there from the start.
        moments: Live tensors of the optimiser by name of the parameter, then by its own names.
        values: The parameters' values by name: the same memory, unknown to autograd; what a
            compiled update reads and writes.
    """

    def __init__(self, network: nn.Module, learning_rate: float, weight_decay: float) -> None:
        """Start with moments of zero; ``weight_decay`` is an L2 penalty."""
        self.network = network
        self.adam = torch.optim.Adam(
            network.parameters(), learning_rate, weight_decay=weight_decay, fused=True
        )
        self._weight_decay = weight_decay
        self._trained = {
            name: parameter
            for name, parameter in network.named_parameters()
            if parameter.requires_grad
        }
        for parameter in network.parameters():
            self.adam.state[parameter] = {
                "step": torch.zeros((), dtype=torch.float32, device=parameter.device),
                "exp_avg": torch.zeros_like(parameter),
                "exp_avg_sq": torch.zeros_like(parameter),
            }
        self.values = values_of(network)
        self.moments: dict[str, dict[str, Tensor]] = {
            name: self.adam.state[parameter] for name, parameter in network.named_parameters()
        }

    def set_learning_rate(self, learning_rate: float) -> None:
        """Use another step size from now on."""
        for group in self.adam.param_groups:
            group["lr"] = learning_rate

    @property
    def learning_rate(self) -> float:
        """The step size."""
        rate: float = self.adam.param_groups[0]["lr"]
        return rate

    def step(
        self,
        loss_of: Callable[[Network], tuple[Tensor, Kept]],
        clip: Clip,
        learning_rate: Tensor,
        *,
        frozen: bool = False,
    ) -> tuple[Tensor, Kept]:
        """Step down the gradient of a loss.

        Args:
            loss_of: From the network, to be called as it is, to the loss () and what else is of
                interest.
            clip: Scales gradients, by name of the parameter, in place; returns norms before that.
            learning_rate: () the step size, as `learning_rate` has it; a compiled update needs it
                as a tensor, because it would be compiled anew for another number.
            frozen: Leave the network as it is.

        Returns:
            The norms, and what else ``loss_of`` gave.
        """
        if torch.compiler.is_compiling():
            return self._compiled_step(loss_of, clip, learning_rate, frozen)
        names, parameters = zip(*self._trained.items(), strict=True)
        with torch.enable_grad():
            loss, kept = loss_of(self.network)
        found = torch.autograd.grad(loss, parameters, materialize_grads=True)
        found = tuple(gradient.contiguous() for gradient in found)  # the fused Adam takes it for so
        norms = clip(dict(zip(names, found, strict=True)))
        for parameter, gradient in zip(parameters, found, strict=True):
            parameter.grad = gradient
        if not frozen:
            self.adam.step()
        return norms, kept

    def _compiled_step(
        self,
        loss_of: Callable[[Network], tuple[Tensor, Kept]],
        clip: Clip,
        learning_rate: Tensor,
        frozen: bool,
    ) -> tuple[Tensor, Kept]:
        def loss_at(values: dict[str, Tensor]) -> tuple[Tensor, Kept]:
            return loss_of(lambda *inputs: functional_call(self.network, values, inputs))

        values = {name: self.values[name] for name in self._trained}
        gradients, kept = grad(loss_at, has_aux=True)(values)
        norms = clip(gradients)
        for name, value in values.items() if not frozen else ():
            moments = self.moments[name]
            gradient = gradients[name] + self._weight_decay * value
            step = moments["step"].add_(1.0)
            mean = moments["exp_avg"].lerp_(gradient, 1.0 - _BETA_1)
            square = moments["exp_avg_sq"].lerp_(gradient.square(), 1.0 - _BETA_2)
            # The corrections for the start: few numbers, so float64 costs nothing.
            mean_share = (1.0 - _BETA_1 ** step.double()).to(value.dtype)
            square_share = (1.0 - _BETA_2 ** step.double()).sqrt().to(value.dtype)
            denominator = square.sqrt() / square_share + _EPSILON
            value.sub_(learning_rate / mean_share * mean / denominator)
        return norms, kept


def values_of(network: nn.Module) -> dict[str, Tensor]:
    """The parameters' values by name: the same memory, unknown to autograd."""
    return {name: parameter.detach() for name, parameter in network.named_parameters()}


def clip_whole(gradients: dict[str, Tensor], limit: float) -> Tensor:
    """Scale all gradients down to a common norm of at most ``limit``, in place.

    Returns:
        () the norm before clipping.
    """
    norms = torch._foreach_norm(list(gradients.values()))
    norm: Tensor = torch.linalg.vector_norm(torch.stack(norms))
    # The small number keeps zeros zero; it is that of torch's own clipping.
    torch._foreach_mul_(list(gradients.values()), (limit / (norm + 1e-6)).clamp_max(1.0))
    return norm


def clip_each_robot(gradients: dict[str, Tensor], limit: float) -> Tensor:
    """Scale each robot's gradient down to a norm of at most ``limit``, in place.

    Every gradient has robots first, (R, ...), or kinds where robots of a kind share parameters.

    Returns:
        (R,) the norms before clipping, or of each kind.
    """
    per_robot = [
        torch.linalg.vector_norm(gradient.flatten(1), dim=1) for gradient in gradients.values()
    ]
    while len(per_robot) > _UNROLLED:
        per_robot = [
            torch.linalg.vector_norm(torch.stack(per_robot[first : first + _UNROLLED]), dim=0)
            for first in range(0, len(per_robot), _UNROLLED)
        ]
    norms: Tensor = torch.linalg.vector_norm(torch.stack(per_robot), dim=0)
    factors = (limit / (norms + 1e-6)).clamp_max(1.0)
    torch._foreach_mul_(
        list(gradients.values()),
        [factors.view(-1, *[1] * (gradient.dim() - 1)) for gradient in gradients.values()],
    )
    return norms
