"""One network and its Adam: the gradient of a loss, and a step down that gradient.

These are the plain forms. `innerattn.learn.compiled` has the forms of a compiled update.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, Protocol, TypeVar

import torch
from torch import Tensor, nn
from torch.optim.adam import adam

Aux = TypeVar("Aux")
Gradients = dict[str, Tensor]
"""Gradients by name of the parameter."""
Forward = Callable[..., Any]
"""A network's forward pass."""
BETA_1, BETA_2, EPSILON = 0.9, 0.999, 1e-8  # torch's defaults, those of the paper on Adam


class Network:
    """A network as an update calls it.

    Attributes:
        module: The network.
        shapes: Of its parameters, by name.
        flat: (P,) its parameters in one piece of memory, in their order.
        values: Its parameters by name: views of `flat`, unknown to autograd.
    """

    def __init__(self, module: nn.Module) -> None:
        """Take over a network that exists: its parameters become views of one tensor."""
        self.module = module
        parameters = dict(module.named_parameters())
        self.shapes = {name: value.shape for name, value in parameters.items()}
        self.flat = torch.cat([value.detach().reshape(-1) for value in parameters.values()])
        self.values = self.by_name(self.flat)
        for name, parameter in parameters.items():
            parameter.data = self.values[name]

    def by_name(self, flat: Tensor) -> dict[str, Tensor]:
        """Views of numbers (P,), one for each parameter, by name and in its shape."""
        parts = flat.split_with_sizes([shape.numel() for shape in self.shapes.values()])
        pairs = zip(self.shapes.items(), parts, strict=True)
        return {name: part.view(shape) for (name, shape), part in pairs}

    def memory(self) -> list[Tensor]:
        """Everything that updates change, in few tensors."""
        return [self.flat]

    def __call__(self, *inputs: Tensor | None) -> Any:
        """The forward pass."""
        return self.module(*inputs)


class Stepper(Protocol):
    """A network that an update trains."""

    flat: Tensor

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


class Segment(NamedTuple):
    """Trained parameters that lie side by side in memory.

    Attributes:
        names: Of the parameters, in their order.
        part: Which part of the network's numbers they are.
        step: () Adam's count of steps.
    """

    names: list[str]
    part: slice
    step: Tensor


class AdamStepper(Network):
    """A network and its Adam (Kingma & Ba 2015), segment by segment.

    Attributes:
        trained: The parameters that are trained, by name.
        segments: The same, as they lie in memory; a network has few segments.
        mean: (P,) Adam's running mean of the gradient; 0 where nothing is trained.
        square: (P,) that of its square.
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
        self.mean, self.square = torch.zeros_like(self.flat), torch.zeros_like(self.flat)
        self.segments = self._found_segments()

    def _found_segments(self) -> list[Segment]:
        segments: list[Segment] = []
        first = 0
        for name, value in self.values.items():
            last = first + value.numel()
            if name in self.trained:
                if segments and segments[-1].part.stop == first:
                    names, part, step = segments.pop()
                    segments.append(Segment([*names, name], slice(part.start, last), step))
                else:
                    step = torch.zeros((), dtype=torch.float32, device=self.flat.device)
                    segments.append(Segment([name], slice(first, last), step))
            first = last
        return segments

    @property
    def moments(self) -> dict[str, dict[str, Tensor]]:
        """Adam's live tensors by name of the parameter, then by Adam's own names.

        Parameters of a segment share their count of steps.
        """
        steps = {name: segment.step for segment in self.segments for name in segment.names}
        means, squares = self.by_name(self.mean), self.by_name(self.square)
        return {
            name: {
                "step": steps.get(name, torch.zeros(())),
                "exp_avg": means[name],
                "exp_avg_sq": squares[name],
            }
            for name in self.values
        }

    def memory(self) -> list[Tensor]:
        """Everything that updates change, in few tensors."""
        return [self.flat, self.mean, self.square, *(segment.step for segment in self.segments)]

    def gradients(self, loss_of: Callable[[Forward], tuple[Tensor, Aux]]) -> tuple[Gradients, Aux]:
        """Gradients of a loss; see `Stepper.gradients`."""
        with torch.enable_grad():
            loss, aux = loss_of(self.module)
        found = torch.autograd.grad(loss, tuple(self.trained.values()), materialize_grads=True)
        return dict(zip(self.trained, found, strict=True)), aux

    def step(self, gradients: Gradients, learning_rate: Tensor) -> None:
        """Do one step of Adam; see `Stepper.step`. Each parameter keeps its gradient as `grad`."""
        for name, parameter in self.trained.items():
            parameter.grad = gradients[name]
        # What `torch.optim.Adam.step` calls. The class itself would load torch's compiler, which
        # takes as long as torch.
        adam(
            [self.flat[segment.part] for segment in self.segments],
            [joined(gradients, segment) for segment in self.segments],
            [self.mean[segment.part] for segment in self.segments],
            [self.square[segment.part] for segment in self.segments],
            [],
            [segment.step for segment in self.segments],
            fused=True,
            amsgrad=False,
            beta1=BETA_1,
            beta2=BETA_2,
            lr=float(learning_rate),
            weight_decay=self.weight_decay,
            eps=EPSILON,
            maximize=False,
        )


def joined(gradients: Gradients, segment: Segment) -> Tensor:
    """(n,) the gradients of a segment in one piece."""
    return torch.cat([gradients[name].reshape(-1) for name in segment.names])
