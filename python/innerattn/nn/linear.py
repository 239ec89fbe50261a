"""A linear layer with one weight matrix per robot, computed as one batched matrix product.

Activations are in the networks that use it.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn


def uniform_parameter(
    shape: tuple[int, ...], fan_in: int, generator: torch.Generator
) -> nn.Parameter:
    """A float32 parameter drawn from U(-1/sqrt(fan_in), 1/sqrt(fan_in)), as torch's own layers.

    Args:
        shape: Shape of the parameter.
        fan_in: Number of inputs of the unit that the parameter feeds.
        generator: Source of the draw, on the CPU; the global generator is not used.
    """
    bound = fan_in**-0.5
    return nn.Parameter(torch.empty(shape).uniform_(-bound, bound, generator=generator))


@torch.no_grad()
def swap_robots(network: nn.Module, one: int, other: int) -> None:
    """Let two robots swap the parameters of all layers that have weights by robot, in place.

    Layers with another first dimension, such as those of a central critic, stay as they are.

    Args:
        network: Whose layers; robots share no parameters in it.
        one: Number of a robot.
        other: Number of another.
    """
    for layer in network.modules():
        if isinstance(layer, PerRobotLinear) and len(layer.weight) > max(one, other):
            for parameter in layer.parameters():
                parameter[[one, other]] = parameter[[other, one]]


def products_plus(bias: Tensor, left: Tensor, right: Tensor) -> Tensor:
    """Add a bias to products: bias + left @ right, of the dtype of the products.

    A compiled program adds the bias where it reads the products next, which saves a pass over them.

    Args:
        bias: Broadcasts to (R, n, m).
        left: (R, n, k).
        right: (R, k, m).

    Returns:
        (R, n, m).
    """
    if torch.compiler.is_compiling():
        products = torch.bmm(left, right)
        return products + bias.to(products.dtype)
    return torch.baddbmm(bias, left, right)


class PerRobotLinear(nn.Module):
    """y_i = W_i x_i + b_i for every robot i.

    Attributes:
        weight: (R, out, in).
        bias: (R, out).
    """

    def __init__(
        self, num_robots: int, in_width: int, out_width: int, generator: torch.Generator
    ) -> None:
        """Draw the parameters.

        Args:
            num_robots: R.
            in_width: Inputs per robot.
            out_width: Outputs per robot.
            generator: Source of the initial parameters, on the CPU.
        """
        super().__init__()
        self.weight = uniform_parameter((num_robots, out_width, in_width), in_width, generator)
        self.bias = uniform_parameter((num_robots, out_width), in_width, generator)

    def forward(self, x: Tensor) -> Tensor:
        """Map (R, B, in) to (R, B, out)."""
        return products_plus(self.bias.unsqueeze(1), x, self.weight.transpose(1, 2))

    def side_by_side(self, left: Tensor, right: Tensor) -> Tensor:
        """Map (R, B, m) and (R, B, in - m), as if concatenated, to (R, B, out); no copy is made."""
        width = left.shape[2]
        weight = self.weight.transpose(1, 2)
        partial = products_plus(self.bias.unsqueeze(1), left, weight[:, :width])
        # Autocast has no in-place products, and a compiler does without them.
        if partial.dtype != weight.dtype or torch.compiler.is_compiling():
            return products_plus(partial, right, weight[:, width:])
        return partial.baddbmm_(right, weight[:, width:])

    def batch_last(self, x: Tensor) -> Tensor:
        """Map (R, B, in) to (R, out, B).

        For few outputs this layout is several times faster, and a following softmax over actions
        runs along memory. The result has the dtype of the parameters, also under autocast.
        """
        weight = self.weight
        outputs = products_plus(self.bias.unsqueeze(2), weight, x.transpose(1, 2))
        return outputs.to(weight.dtype)
