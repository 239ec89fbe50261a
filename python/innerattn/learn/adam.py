"""One network and its Adam: the gradient of a loss, and a step down that gradient.

These are the plain forms. `innerattn.learn.compiled` has the forms of a compiled update.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol, TypeVar

import torch
from torch import Tensor, nn

Aux = TypeVar("Aux")
Gradients = dict[str, Tensor]
"""Gradients by name of the parameter."""
Forward = Callable[..., Any]
"""A network's forward pass."""


class Network:
    """A network as an update calls it.

    Attributes:
        module: The network.
        values: Its parameters by name: the same memory, unknown to autograd.
    """

    def __init__(self, module: nn.Module) -> None:
        """Take over a network that exists."""
        self.module = module
        self.values = {name: value.detach() for name, value in module.named_parameters()}

    def __call__(self, *inputs: Tensor | None) -> Any:
        """The forward pass."""
        return self.module(*inputs)


class Stepper(Protocol):
    """A network that an update trains."""

    values: dict[str, Tensor]

    def __call__(self, *inputs: Tensor | None) -> Any:
        """The forward pass."""

    def gradients(self, loss_of: Callable[[Forward], tuple[Tensor, Aux]]) -> tuple[Gradients, Aux]:
        """Gradients of a loss.

        Args:
            loss_of: From the network's forward pass to the loss () and whatever else is of
                interest, which has no gradient.

        Returns:
            Gradients of the trained parameters, and what else ``loss_of`` gave.
        """

    def step(self, gradients: Gradients, learning_rate: Tensor) -> None:
        """Do one step of Adam.

        Args:
            gradients: Those of `gradients`, changed or not.
            learning_rate: () float64 on the CPU, the step size. It is a tensor because a graph
                would be compiled anew for every other number.
        """


class AdamStepper(Network):
    """A network and its Adam (Kingma & Ba 2015), operation by operation.

    Attributes:
        trained: The parameters that are trained, by name.
        moments: Adam's tensors by name of the parameter, then by Adam's own names.
        weight_decay: Weight of the L2 penalty.
    """

    def __init__(self, module: nn.Module, weight_decay: float = 0.0) -> None:
        """Start with moments of zero."""
        super().__init__(module)
        self.weight_decay = weight_decay
        self.trained = {
            name: parameter
            for name, parameter in module.named_parameters()
            if parameter.requires_grad
        }
        self._adam = torch.optim.Adam(module.parameters(), weight_decay=weight_decay, fused=True)
        for parameter in module.parameters():
            self._adam.state[parameter] = {
                "step": torch.zeros((), dtype=torch.float32, device=parameter.device),
                "exp_avg": torch.zeros_like(parameter),
                "exp_avg_sq": torch.zeros_like(parameter),
            }
        self.moments: dict[str, dict[str, Tensor]] = {
            name: self._adam.state[parameter] for name, parameter in module.named_parameters()
        }

    def gradients(self, loss_of: Callable[[Forward], tuple[Tensor, Aux]]) -> tuple[Gradients, Aux]:
        """Gradients of a loss; see `Stepper.gradients`."""
        with torch.enable_grad():
            loss, aux = loss_of(self.module)
        found = torch.autograd.grad(loss, tuple(self.trained.values()), materialize_grads=True)
        # The fused Adam takes every gradient for contiguous.
        pairs = zip(self.trained, found, strict=True)
        return {name: gradient.contiguous() for name, gradient in pairs}, aux

    def step(self, gradients: Gradients, learning_rate: Tensor) -> None:
        """Do one step of Adam; see `Stepper.step`."""
        for name, parameter in self.trained.items():
            parameter.grad = gradients[name]
        for group in self._adam.param_groups:
            group["lr"] = float(learning_rate)
        self._adam.step()
