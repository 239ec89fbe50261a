"""Encoders of observations: of the whole row, or entity by entity.

They know which columns belong to which entity, not what a column means.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor, nn
from torch.nn import functional

from innerattn.nn.linear import PerRobotLinear

_HEAD_WIDTH = 8


@dataclass(frozen=True)
class EntityColumns:
    """Which entity the columns of an observation belong to: robot, then teammates, then victims.

    Attributes:
        own: Columns of the robot itself.
        teammates: Number of teammates.
        teammate: Columns of each teammate.
        victims: Number of victims, at least 1.
        victim: Columns of each victim.
        present: Index among a victim's columns of the one that is above 0.5 if there is a victim.
    """

    own: int
    teammates: int
    teammate: int
    victims: int
    victim: int
    present: int

    @property
    def width(self) -> int:
        """D, columns of a whole observation."""
        return self.own + self.teammates * self.teammate + self.victims * self.victim


class EntityEncoder(nn.Module):
    """Encodes a robot, its teammates and the victims separately, whatever the order of their slots.

    Every robot has its own parameters, and uses the same ones for all its teammates (victims):

        e = phi(W_own own),  v_k = phi(W_v victim_k),  t_k = phi(W_t teammate_k)
        y = W [e, sum_k alpha_k v_k, sum_k beta_k t_k]

    where alpha is the softmax over the victims present of q . v_k / sqrt(d) with q = W_q e, per
    head, and beta likewise over teammates. The sum over no entity is zero. Every layer has a bias.
    Inside, the batch is the last dimension, so that sums over few entities run along memory.
    """

    def __init__(
        self,
        num_robots: int,
        columns: EntityColumns,
        extra_width: int,
        out_width: int,
        generator: torch.Generator,
    ) -> None:
        """Draw the parameters.

        Args:
            num_robots: R.
            columns: The columns of an observation.
            extra_width: Further columns behind them, which belong to the robot itself.
            out_width: Outputs per robot; encodings of entities have a quarter of this width, in
                heads of 8.
            generator: Source of the initial parameters, on the CPU.
        """
        super().__init__()
        self._columns = columns
        self._heads = max(1, out_width // (4 * _HEAD_WIDTH))
        width = self._heads * _HEAD_WIDTH
        pools = 2 if columns.teammates else 1
        self.own = PerRobotLinear(num_robots, columns.own + extra_width, width, generator)
        self.victim = PerRobotLinear(num_robots, columns.victim, width, generator)
        self.teammate = None
        if columns.teammates:
            self.teammate = PerRobotLinear(num_robots, columns.teammate, width, generator)
        self.query = PerRobotLinear(num_robots, width, pools * width, generator)
        self.output = PerRobotLinear(num_robots, (1 + pools) * width, out_width, generator)

    def forward(self, obs: Tensor) -> Tensor:
        """Map observations, with extra columns behind them, (R, B, D + extra) to (R, B, out)."""
        columns = self._columns
        widths = [
            columns.own,
            columns.teammates * columns.teammate,
            columns.victims * columns.victim,
            obs.shape[2] - columns.width,
        ]
        own, teammates, victims, extra = torch.split(obs, widths, dim=2)
        own = functional.leaky_relu_(self.own.batch_last(torch.cat([own, extra], dim=2)))
        width = own.shape[1]
        queries = self.query.batch_last(own.transpose(1, 2)) * _HEAD_WIDTH**-0.5
        blocks = _blocks(victims, columns.victims)
        present = blocks[..., columns.present] > 0.5
        parts = [own, self._pool(self.victim, blocks, queries[:, :width], present)]
        if self.teammate is not None:
            blocks = _blocks(teammates, columns.teammates)
            parts.append(self._pool(self.teammate, blocks, queries[:, width:], None))
        hidden: Tensor = self.output(torch.cat(parts, dim=1).transpose(1, 2))
        return hidden

    def _pool(
        self, layer: PerRobotLinear, blocks: Tensor, queries: Tensor, present: Tensor | None
    ) -> Tensor:
        """Attend to entities.

        Args:
            layer: Encodes an entity.
            blocks: (R, K, B, columns), K entities.
            queries: (R, W, B), divided by sqrt(d).
            present: (R, K, B) bool, the entities that are there; None: all are.

        Returns:
            (R, W, B) the weighted encodings, with heads concatenated.
        """
        robots, entities, batch, _ = blocks.shape
        encoded = functional.leaky_relu_(layer.batch_last(blocks.flatten(1, 2)))
        encoded = encoded.view(robots, self._heads, _HEAD_WIDTH, entities, batch)
        asked = queries.view(robots, self._heads, _HEAD_WIDTH, 1, batch)
        scores = (asked * encoded).sum(dim=2)  # (R, H, K, B)
        if present is None:
            weights = scores.softmax(dim=2)
        else:
            # The lowest finite number instead of -inf avoids NaN in a world without victims; the
            # softmax then gives equal weights, which the product sets to 0.
            seen = present.unsqueeze(1)
            scores = scores.masked_fill(~seen, torch.finfo(scores.dtype).min)
            weights = scores.softmax(dim=2) * seen
        pooled: Tensor = (weights.unsqueeze(2) * encoded).sum(dim=3)
        return pooled.view(robots, -1, batch)


def _blocks(columns: Tensor, count: int) -> Tensor:
    """Bring the columns of ``count`` entities (R, B, count * n) to (R, count, B, n)."""
    robots, batch, width = columns.shape
    return columns.view(robots, batch, count, width // count).transpose(1, 2)


def observation_encoder(
    num_robots: int,
    obs_width: int,
    out_width: int,
    generator: torch.Generator,
    entities: EntityColumns | None,
    extra_width: int = 0,
) -> PerRobotLinear | EntityEncoder:
    """A layer that maps (R, B, D + extra) to (R, B, out).

    Args:
        num_robots: R.
        obs_width: D.
        out_width: Outputs per robot.
        generator: Source of the initial parameters, on the CPU.
        entities: Columns of the entities to encode separately; None: encode the whole row.
        extra_width: Columns behind an observation.
    """
    if entities is None:
        return PerRobotLinear(num_robots, obs_width + extra_width, out_width, generator)
    return EntityEncoder(num_robots, entities, extra_width, out_width, generator)
