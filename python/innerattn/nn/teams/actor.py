"""The policy of any team: each pair proposes an action, and attention over victims decides."""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional

from innerattn.nn.teams.features import WORKED_OUT, plain
from innerattn.nn.teams.frames import turn_back_choices
from innerattn.nn.teams.pooling import POOLINGS, Pooling, as_table
from innerattn.nn.teams.relations import (
    HOME_WIDTH,
    NEAREST,
    PAIR_TURNING_WIDTH,
    PAIR_WIDTH,
    Relations,
)

NUM_CHOICES = 5
_HOME_HIDDEN = 32
_SHARPNESS = 10.0
"""Outputs begin small, so that all actions begin alike, and are to grow soon."""


def layer(inputs: int, outputs: int, gain: float = 2.0**0.5) -> nn.Linear:
    """A linear layer with orthogonal weights and no bias at first."""
    made = nn.Linear(inputs, outputs)
    nn.init.orthogonal_(made.weight, gain)
    nn.init.zeros_(made.bias)
    return made


class TeamActor(nn.Module):
    """Log-probabilities of the actions of every robot in every world.

    Each pair (robot, victim) is encoded and sees the robot's other pairs (by their maximum). Twice
    it sees the pairs of rivals and of partners at its victim (by a pooling) and again the robot's
    own: the second time these know of their own rivals and partners. Then it gives a weight w_v and
    a distribution p_v over actions in its own frame; so does the robot's way home. The policy is
    the mixture pi(a) = sum_v softmax(w)_v p_v(a).
    """

    def __init__(
        self, width: int, pooling: str, key_width: int, *, plain_features: bool = False
    ) -> None:
        """Draw initial weights from torch's global generator.

        Args:
            width: H, hidden units.
            pooling: one of `POOLINGS`.
            key_width: width of queries and keys, where the pooling has any.
            plain_features: leave out all columns that are worked out. Their weights are 0 and stay
                so; exported networks need not know of it.
        """
        super().__init__()
        self.width, self.plain_features = width, plain_features
        self.first, self.second = layer(PAIR_WIDTH, width), layer(2 * width, width)
        self.rivals, self.partners, self.rivals_again, self.partners_again = (
            POOLINGS[pooling](width, key_width) for _ in range(4)
        )
        self.third = layer(4 * width, width)
        self.fourth = layer(PAIR_WIDTH + PAIR_TURNING_WIDTH + 4 * width, width)
        self.fifth, self.out = layer(width, width), layer(width, 1 + NUM_CHOICES, 0.01)
        self.home = layer(HOME_WIDTH + width, _HOME_HIDDEN)
        self.home_out = layer(_HOME_HIDDEN, 1 + NUM_CHOICES, 0.01)
        if plain_features:
            turning = tuple(PAIR_WIDTH + column for column in WORKED_OUT["turning"])
            for one, columns in (
                (self.first, WORKED_OUT["pairs"]),
                (self.fourth, WORKED_OUT["pairs"] + turning),
                (self.home, WORKED_OUT["homes"]),
            ):
                one.weight.data[:, columns] = 0.0

    def forward(self, seen: Relations) -> Tensor:
        """Log-probabilities (N, 5) of stay, +x, -x, +y, -y for all robots of all worlds."""
        seen = plain(seen) if self.plain_features else seen
        robots = len(seen.homes)

        def of_robot(rows: Tensor) -> Tensor:
            return as_table(rows, seen.slots, robots, NEAREST).amax(1)

        def of_own(rows: Tensor) -> Tensor:
            return of_robot(rows).index_select(0, seen.robots)

        def of_others(rows: Tensor, rivals: Pooling, partners: Pooling) -> list[Tensor]:
            at_victims = as_table(rows, seen.cells, *seen.times.shape)
            return [
                pool(rows, at_victims, seen.cells, masks, seen.times)
                for pool, masks in ((rivals, seen.rivals), (partners, seen.partners))
            ]

        rows = functional.relu(self.first(seen.pairs))
        rows = functional.relu(self.second(torch.cat([rows, of_own(rows)], 1)))
        parts = [rows, *of_others(rows, self.rivals, self.partners), of_own(rows)]
        rows = functional.relu(self.third(torch.cat(parts, 1)))
        own, others = of_robot(rows), of_others(rows, self.rivals_again, self.partners_again)
        parts = [seen.pairs, seen.turning, rows, *others, own.index_select(0, seen.robots)]
        rows = functional.relu(self.fourth(torch.cat(parts, 1)))
        out = self.out(functional.relu(self.fifth(rows))) * _SHARPNESS
        home = self.home(torch.cat([seen.homes, own], 1))
        home = self.home_out(functional.relu(home)) * _SHARPNESS

        weights = out.new_full((robots * NEAREST,), -torch.inf)
        weights = weights.index_copy(0, seen.slots, out[:, 0]).view(robots, NEAREST)
        weights = torch.cat([weights, home[:, :1]], 1).log_softmax(1)
        choices = turn_back_choices(out[:, 1:].log_softmax(1), seen.frames)
        table = as_table(choices, seen.slots, robots, NEAREST)
        at_home = turn_back_choices(home[:, 1:].log_softmax(1), seen.home_frames)
        mixed = torch.cat([table, at_home[:, None]], 1) + weights[..., None]
        return mixed.logsumexp(1)
