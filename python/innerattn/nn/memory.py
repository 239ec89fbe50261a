"""Networks with a memory: what each robot saw before goes into its decisions and its values.

A gated recurrent unit (Cho et al. 2014) reads a robot's observations one after the other. The
network behind it takes the observation and what the robot remembers side by side. This module knows
neither episodes nor losses: a caller says where a sequence begins anew.

Observations may come in frames that turn from step to step (see `innerattn.nn.symmetry`). Half of a
memory is vectors, which turn with the frame, so that what they say of the world stays the same.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

from innerattn.nn.actor import Actor
from innerattn.nn.critic import CriticOutput
from innerattn.nn.linear import PerRobotLinear
from innerattn.nn.symmetry import NUM_ELEMENTS, inverse, turned_signs


class Memory(nn.Module):
    """One gated recurrent unit for each robot; its equations are those of `torch.nn.GRU`.

    Attributes:
        width: W, numbers that a robot remembers, each in -1 to 1.
    """

    def __init__(
        self, num_robots: int, obs_width: int, width: int, generator: torch.Generator
    ) -> None:
        """Draw the parameters.

        Args:
            num_robots: R.
            obs_width: D.
            width: W.
            generator: Source of the initial parameters, on the CPU.
        """
        super().__init__()
        self.width = width
        self.of_input = PerRobotLinear(num_robots, obs_width, 3 * width, generator)
        self.of_past = PerRobotLinear(num_robots, width, 3 * width, generator)

    def forward(
        self, obs: Tensor, past: Tensor, begins: Tensor | None = None, turns: Tensor | None = None
    ) -> list[Tensor]:
        """What robots remember after each step of n sequences.

        Args:
            obs: (R, L n, D), all first steps, then all second ones.
            past: (R, n, W) what robots remembered before the first step.
            begins: (L, n) bool, steps at which an episode begins, before which everything is
                forgotten; None: one step, at which none does.
            turns: (R, L n) int64, elements that turn the frame of the step before into that of each
                step; None: frames do not turn.

        Returns:
            L tensors (R, n, W), each in the frame of its step.
        """
        robots, count, width = past.shape
        shape = robots, 1 if begins is None else len(begins), count
        # Once for all steps: robots of a kind gather their weights at each look.
        weight, bias = self.of_past.weight.transpose(1, 2), self.of_past.bias.unsqueeze(1)
        read = self.of_input(obs).view(*shape, 3, width).unbind(1)
        forms = None if turns is None else _forms(turns.reshape(shape), past)
        found = []
        for step in range(shape[1]):
            if begins is not None:
                past = past.masked_fill(begins[step].unsqueeze(1), 0.0)
            if forms is not None:
                past = _turned(past, *forms[step])
            recalled = torch.baddbmm(bias, past, weight).view(read[step].shape)
            past = _gated(read[step], recalled, past)
            found.append(past)
        return found


def _gated(read: Tensor, recalled: Tensor, past: Tensor) -> Tensor:
    """(R, n, W) from what was read and recalled, (R, n, 3, W) each, and (R, n, W)."""
    of_reset, of_update, of_new = read.unbind(2)
    past_reset, past_update, past_new = recalled.unbind(2)
    kept = (of_update + past_update).sigmoid()
    new = (of_new + (of_reset + past_reset).sigmoid() * past_new).tanh()
    return torch.lerp(new, past.to(new.dtype), kept)


class Remembering(nn.Module):
    """A network behind a memory.

    Attributes:
        memory: What robots remember.
        network: Takes observations (R, B, D + W), what is remembered last.
    """

    def __init__(self, memory: Memory, network: nn.Module) -> None:
        """Put a network, for observations of D + W columns, behind a memory of W numbers."""
        super().__init__()
        self.memory, self.network = memory, network

    def remember(self, obs: Tensor, past: Tensor, element: Tensor | None = None) -> Tensor:
        """What robots remember after one more observation.

        Args:
            obs: (R, n, D).
            past: (R, n, W) what they remembered before; vectors lie as in the world.
            element: (R, n) int64, elements that turned the world into the frames of ``obs``.

        Returns:
            (R, n, W); vectors lie as in the world.
        """
        return _as_in_world(self.memory(obs, past, None, element)[0], element)

    def _inputs(
        self, obs: Tensor, past: Tensor, begins: Tensor | None, turns: Tensor | None
    ) -> Tensor:
        """Observations (R, L n, D + W) with what robots remember beside them."""
        remembered = torch.cat(self.memory(obs, past, begins, turns), dim=1)
        return torch.cat([obs, remembered.to(obs.dtype)], dim=2)


class RememberingActor(Remembering):
    """The policies of all robots, each with a memory; `network` is an `innerattn.nn.Actor`."""

    def __init__(self, memory: Memory, network: Actor) -> None:
        """Put policies behind a memory; arguments as in `Remembering`."""
        super().__init__(memory, network)
        self.num_robots = network.num_robots

    def forward(
        self,
        obs: Tensor,
        past: Tensor,
        begins: Tensor | None = None,
        turns: Tensor | None = None,
    ) -> Tensor:
        """Map observations (R, L n, D) to action logits (R, A, L n); see `Memory.forward`."""
        logits: Tensor = self.network(self._inputs(obs, past, begins, turns))
        return logits

    def act(
        self, obs: Tensor, past: Tensor, element: Tensor | None = None
    ) -> tuple[Tensor, Tensor]:
        """The logits (R, A, n) of one step, and what `remember` gives; arguments as there."""
        (remembered,) = self.memory(obs, past, None, element)
        logits: Tensor = self.network(torch.cat([obs, remembered.to(obs.dtype)], dim=2))
        return logits, _as_in_world(remembered, element)


class RememberingCritic(Remembering):
    """The critics of all robots, each with a memory; `network` gives a `CriticOutput`."""

    def forward(
        self,
        obs: Tensor,
        actions: Tensor,
        available: Tensor | None,
        past: Tensor,
        begins: Tensor | None = None,
        turns: Tensor | None = None,
    ) -> CriticOutput:
        """Value every own action, or the state.

        Args:
            obs: (R, L n, D).
            actions: (R, L n) int64.
            available: (L n, R) bool; None: all are available.
            past: (R, n, W); see `Memory.forward`, also for the rest.
            begins: (L, n) bool, or None.
            turns: (R, L n) int64, or None.
        """
        inputs = self._inputs(obs, past, begins, turns)
        output: CriticOutput = self.network(inputs, actions, available)
        return output


def _as_in_world(remembered: Tensor, element: Tensor | None) -> Tensor:
    """Memories (R, n, W) of the frames into which the world was turned by elements (R, n)."""
    return remembered if element is None else turned_memory(remembered, inverse(element))


def turned_memory(remembered: Tensor, element: Tensor) -> Tensor:
    """What is remembered (..., W) in worlds turned by elements (...).

    The first half of it stays; then come the x, and last the y of W / 4 vectors.
    """
    (form,) = _forms(element.unsqueeze(1), remembered)
    return _turned(remembered, *form)


def _forms(elements: Tensor, like: Tensor) -> list[tuple[Tensor, Tensor]]:
    """For each step of elements (R, L, n): signs (R, n, W), and (R, n, 1) whether x and y swap."""
    quarter = like.shape[-1] // 4
    x, y = turned_signs(elements)
    signs = torch.stack([torch.ones_like(x), torch.ones_like(x), x, y], dim=-1).to(like.dtype)
    signs = signs.repeat_interleave(quarter, dim=-1)
    swaps = (elements >= NUM_ELEMENTS // 2).unsqueeze(-1)
    return list(zip(signs.unbind(1), swaps.unbind(1), strict=True))


def _turned(remembered: Tensor, signs: Tensor, swaps: Tensor) -> Tensor:
    quarter = remembered.shape[-1] // 4
    plain, x, y = remembered.split_with_sizes([2 * quarter, quarter, quarter], dim=-1)
    return torch.where(swaps, torch.cat([plain, y, x], dim=-1), remembered) * signs
