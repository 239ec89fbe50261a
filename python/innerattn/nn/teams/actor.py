"""The policy of any team: each pair proposes an action, and attention over victims decides."""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional

from innerattn.nn.teams.features import Bodies, Features, hidden_columns, without
from innerattn.nn.teams.frames import turn_back_choices
from innerattn.nn.teams.layers import BODY_WIDTH, BodyLayer, layer
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


class TeamActor(nn.Module):
    """Log-probabilities of the actions of every robot in every world.

    Each pair (robot, victim) is encoded and sees the robot's other pairs (by their maximum). Twice
    it sees the pairs of rivals and of partners at its victim (by a pooling) and again the robot's
    own: the second time these know of their own rivals and partners. Then it gives a weight w_v and
    a distribution p_v over actions in its own frame; so does the robot's way home. The policy is
    the mixture pi(a) = sum_v softmax(w)_v p_v(a).
    """

    def __init__(
        self,
        width: int,
        pooling: str,
        key_width: int,
        *,
        features: Features = "all",
        bodies: Bodies = "told",
    ) -> None:
        """Draw initial weights from torch's global generator.

        Args:
            width: H, hidden units.
            pooling: one of `POOLINGS`.
            key_width: width of queries and keys, where the pooling has any.
            features: "plain" leaves out all columns that are worked out.
            bodies: "hidden" leaves out bodies; so does "hypernetwork", but a network makes the last
                layer for victims of each robot's body.
        """
        super().__init__()
        self.width, self.hidden = width, hidden_columns(features, bodies)
        self.first, self.second = layer(PAIR_WIDTH, width), layer(2 * width, width)
        self.rivals, self.partners, self.rivals_again, self.partners_again = (
            POOLINGS[pooling](width, key_width) for _ in range(4)
        )
        self.third = layer(4 * width, width)
        self.fourth = layer(PAIR_WIDTH + PAIR_TURNING_WIDTH + 4 * width, width)
        self.fifth = layer(width, width)
        self.made_of_bodies = bodies == "hypernetwork"
        last = BodyLayer if self.made_of_bodies else layer
        self.out = last(width, 1 + NUM_CHOICES, 0.01)
        self.home = layer(HOME_WIDTH + width, _HOME_HIDDEN)
        self.home_out = layer(_HOME_HIDDEN, 1 + NUM_CHOICES, 0.01)
        pairs = self.hidden.get("pairs", ())
        turning = (PAIR_WIDTH + column for column in self.hidden.get("turning", ()))
        for one, columns in (
            (self.first, pairs),
            (self.fourth, (*pairs, *turning)),
            (self.home, self.hidden.get("homes", ())),
        ):
            one.weight.data[:, columns] = 0.0

    def forward(self, seen: Relations) -> Tensor:
        """Log-probabilities (N, 5) of stay, +x, -x, +y, -y for all robots of all worlds."""
        bodies = seen.homes[:, :BODY_WIDTH]
        seen = without(seen, self.hidden)
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
        rows = functional.relu(self.fifth(rows))
        made = (seen.robots, bodies) if self.made_of_bodies else ()
        out = self.out(rows, *made) * _SHARPNESS
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
