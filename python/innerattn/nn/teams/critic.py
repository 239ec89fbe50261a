"""The value of a world for its whole team, whatever the team."""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional

from innerattn.nn.teams.features import Features, hidden_columns, without
from innerattn.nn.teams.layers import layer
from innerattn.nn.teams.pooling import as_table
from innerattn.nn.teams.relations import (
    PAIR_WIDTH,
    ROBOT_WIDTH,
    VICTIM_WIDTH,
    WORLD_WIDTH,
    Relations,
)

_ROBOT_HIDDEN, _VICTIM_HIDDEN, _HIDDEN = 32, 64, 96


class TeamCritic(nn.Module):
    """V of a world, from sums and maxima over its pairs, victims and robots."""

    def __init__(self, *, features: Features = "all") -> None:
        """Draw initial weights from torch's global generator.

        Args:
            features: "plain" leaves out all columns that are worked out.
        """
        super().__init__()
        self.hidden = hidden_columns(features, "told")
        self.pair = layer(PAIR_WIDTH, _ROBOT_HIDDEN)
        self.victim = layer(VICTIM_WIDTH + 2 * _ROBOT_HIDDEN, _VICTIM_HIDDEN)
        self.robot = layer(ROBOT_WIDTH, _ROBOT_HIDDEN)
        self.world = layer(_VICTIM_HIDDEN + 2 * _ROBOT_HIDDEN + WORLD_WIDTH, _HIDDEN)
        self.out = layer(_HIDDEN, 1, 0.1)

    def forward(self, seen: Relations) -> Tensor:
        """Values (B,), as many returns' standard deviations above their mean."""
        seen = without(seen, self.hidden)
        victims, size = seen.times.shape
        worlds = len(seen.worlds)
        pairs = functional.relu(self.pair(seen.pairs))
        table = as_table(pairs, seen.cells, victims, size)
        parts = [seen.victims, table.amax(1), table.sum(1) / 4.0]
        rows = functional.relu(self.victim(torch.cat(parts, 1)))
        at_victims = rows.new_zeros(worlds, rows.shape[1]).index_add(0, seen.victim_worlds, rows)
        robots = functional.relu(self.robot(seen.team))
        team = as_table(robots, seen.robot_cells, worlds, size)
        parts = [at_victims, team.sum(1) / 4.0, team.amax(1), seen.worlds]
        found: Tensor = self.out(functional.relu(self.world(torch.cat(parts, 1))))
        return found.squeeze(1)
