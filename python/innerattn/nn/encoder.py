"""Encoders of observations: of the whole row, or entity by entity.

They know which columns belong to which entity, not what a column means.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import torch
from torch import Tensor, nn
from torch.nn import functional

from innerattn.nn.linear import PerRobotLinear
from innerattn.nn.pooling import largest, mean, nearest_one

_HEAD_WIDTH = 8
_YES = 0.5


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
        seen: Index among a teammate's columns of the one that is above 0.5 if the robot sees it;
            None: no column says so.
        teammate_place: Indices among a teammate's columns of x and y, relative to the robot; None:
            there are none.
        victim_place: The same of a victim.
    """

    own: int
    teammates: int
    teammate: int
    victims: int
    victim: int
    present: int
    seen: int | None = None
    teammate_place: tuple[int, int] | None = None
    victim_place: tuple[int, int] | None = None

    @property
    def width(self) -> int:
        """D, columns of a whole observation."""
        return self.own + self.teammates * self.teammate + self.victims * self.victim


class Entities(NamedTuple):
    """What observations say of entities.

    Attributes:
        own: (R, B, n) the columns of the robot itself, and extra ones.
        victims: (R, columns, K, B).
        there: (R, K, B) bool, the victims that are there.
        teammates: (R, columns, K, B); anything, if there are none.
        known: (R, K, B) bool, the teammates that are there; None: all are.
    """

    own: Tensor
    victims: Tensor
    there: Tensor
    teammates: Tensor
    known: Tensor | None


class EntityEncoder(nn.Module):
    """Encodes a robot, its teammates and the victims separately, whatever the order of their slots.

    Every robot has its own parameters, and uses the same ones for all its teammates (victims):

        e = phi(W_own own),  v_k = phi(W_v victim_k),  t_k = phi(W_t teammate_k)
        y = W [e, pool of v_k, pool of t_k]

    A pool is over the victims (teammates) that are there, and zero where none is:

        attention: sum_k alpha_k v_k, alpha = softmax over k of q . v_k / sqrt(d), per head
        mean:      their mean
        max:       the largest of them, number by number
        nearest:   that of the one nearest to the robot, the first of equally near ones

    The query is q = W_q e, with another W_q for teammates than for victims.

    Victims are there where their column says so, and so are teammates, if they have such a column.
    Without it attention takes all teammates, and the other pools those with a number that is not 0:
    all columns of a teammate are 0 where nothing is known of it.

    Every layer has a bias. Inside, the batch is the last dimension, so that sums over few entities
    run along memory.
    """

    def __init__(
        self,
        num_robots: int,
        columns: EntityColumns,
        extra_width: int,
        out_width: int,
        generator: torch.Generator,
        pooling: str = "attention",
    ) -> None:
        """Draw the parameters.

        Args:
            num_robots: R.
            columns: The columns of an observation.
            extra_width: Further columns behind them, which belong to the robot itself.
            out_width: Outputs per robot; encodings of entities have a quarter of this width, in
                heads of 8.
            generator: Source of the initial parameters, on the CPU.
            pooling: "attention", "mean", "max" or "nearest".

        Raises:
            ValueError: The pooling is "nearest", and no columns say where entities are.
        """
        super().__init__()
        if pooling == "nearest":
            places = [columns.victim_place] + [columns.teammate_place] * bool(columns.teammates)
            if None in places:
                raise ValueError(
                    f"columns = {columns}: network.pooling = 'nearest' needs the places of entities"
                )
        self._columns, self._pooling = columns, pooling
        self._heads = max(1, out_width // (4 * _HEAD_WIDTH))
        width = self._heads * _HEAD_WIDTH
        pools = 2 if columns.teammates else 1
        self.own = PerRobotLinear(num_robots, columns.own + extra_width, width, generator)
        self.victim = PerRobotLinear(num_robots, columns.victim, width, generator)
        self.teammate = None
        if columns.teammates:
            self.teammate = PerRobotLinear(num_robots, columns.teammate, width, generator)
        self.query = None
        if pooling == "attention":
            self.query = PerRobotLinear(num_robots, width, pools * width, generator)
        self.output = PerRobotLinear(num_robots, (1 + pools) * width, out_width, generator)

    def forward(self, obs: Tensor) -> Tensor:
        """Map observations, with extra columns behind them, (R, B, D + extra) to (R, B, out)."""
        return self.encode(self.read(obs))

    def read(self, obs: Tensor) -> Entities:
        """Take observations (R, B, D) apart, which may have extra columns behind them."""
        columns = self._columns
        widths = [
            columns.own,
            columns.teammates * columns.teammate,
            columns.victims * columns.victim,
            obs.shape[2] - columns.width,
        ]
        own, teammates, victims, extra = torch.split(obs, widths, dim=2)
        victims = _blocks(victims, columns.victims)
        there = victims[:, columns.present] > _YES
        known = None
        if self.teammate is not None:
            teammates = _blocks(teammates, columns.teammates)
            known = self._known(teammates)
        return Entities(torch.cat([own, extra], dim=2), victims, there, teammates, known)

    def encode(self, seen: Entities, *beside: Tensor) -> Tensor:
        """Encode what observations say of entities.

        Args:
            seen: By `read` of this or an equal encoder.
            beside: (R, B, n), the last n of the extra columns, where observations lacked them.

        Returns:
            (R, B, out).
        """
        columns = self._columns
        own, queries = self._own_and_queries(torch.cat([seen.own, *beside], dim=2))
        width = own.shape[1]
        encoded = _encoded(self.victim, seen.victims)
        asked = None if queries is None else queries[:, :width]
        parts = [own, self._pool(encoded, seen.victims, seen.there, columns.victim_place, asked)]
        if self.teammate is not None:
            encoded = _encoded(self.teammate, seen.teammates)
            asked = None if queries is None else queries[:, width:]
            place = columns.teammate_place
            parts.append(self._pool(encoded, seen.teammates, seen.known, place, asked))
        return self.output.batch_last(torch.cat(parts, dim=1).transpose(1, 2)).transpose(1, 2)

    def teammate_weights(self, obs: Tensor) -> Tensor | None:
        """The weights with which teammates are summed up.

        Args:
            obs: (R, B, D + extra).

        Returns:
            (R, H, K, B): those of each robot on its K teammates, which add up to 1, or to 0 where
            it sees none. None without teammates, or if the pooling is not "attention".
        """
        seen = self.read(obs)
        own, queries = self._own_and_queries(seen.own)
        if queries is None or self.teammate is None:
            return None
        encoded = _encoded(self.teammate, seen.teammates)
        return _weights(*self._by_head(encoded, queries[:, own.shape[1] :]), seen.known)

    def _own_and_queries(self, own: Tensor) -> tuple[Tensor, Tensor | None]:
        """Encodings (R, W, B) of robots (R, B, n) themselves, and their queries (R, pools * W, B).

        Queries are divided by sqrt(d); None: nothing is asked.
        """
        encoded = functional.leaky_relu_(self.own.batch_last(own))
        if self.query is None:
            return encoded, None
        return encoded, self.query.batch_last(encoded.transpose(1, 2)) * _HEAD_WIDTH**-0.5

    def _known(self, teammates: Tensor) -> Tensor | None:
        """(R, K, B) bool: which teammates (R, columns, K, B) are there; None: all are."""
        if self._columns.seen is not None:
            return teammates[:, self._columns.seen] > _YES
        if self._pooling == "attention":
            return None
        return teammates.abs().amax(dim=1) > 0.0

    def _by_head(self, encoded: Tensor, queries: Tensor) -> tuple[Tensor, Tensor]:
        """Encodings (R, W, K, B) as (R, H, d, K, B), and queries (R, W, B) as (R, H, d, 1, B)."""
        robots, _, entities, batch = encoded.shape
        shape = (robots, self._heads, _HEAD_WIDTH)
        return encoded.view(*shape, entities, batch), queries.view(*shape, 1, batch)

    def _pool(
        self,
        encoded: Tensor,
        blocks: Tensor,
        there: Tensor | None,
        place: tuple[int, int] | None,
        queries: Tensor | None,
    ) -> Tensor:
        """Sum up the encodings of entities.

        Args:
            encoded: (R, W, K, B), K entities.
            blocks: (R, columns, K, B), of what.
            there: (R, K, B) bool, the entities that are there; None: all are.
            place: Columns x and y of an entity's place.
            queries: (R, W, B), divided by sqrt(d), if the pooling is "attention".

        Returns:
            (R, W, B).
        """
        if queries is not None:
            return _attend(*self._by_head(encoded, queries), there).flatten(1, 2)
        assert there is not None  # as only "attention" takes all
        if self._pooling == "max":
            return largest(encoded, there.unsqueeze(1), dim=2)
        if self._pooling == "nearest":
            assert place is not None  # as checked where it was made
            x, y = (blocks[:, axis] for axis in place)
            weights = nearest_one(there, x.square() + y.square()).to(encoded.dtype)
            return (weights.unsqueeze(1) * encoded).sum(dim=2)
        return mean(encoded, there.unsqueeze(1), dim=2)


def _encoded(layer: PerRobotLinear, blocks: Tensor) -> Tensor:
    """Encodings (R, W, K, B) of K entities (R, columns, K, B)."""
    encoded = torch.bmm(layer.weight, blocks.flatten(2)).to(layer.weight.dtype)
    encoded = encoded.add_(layer.bias.unsqueeze(2)).view(len(blocks), -1, *blocks.shape[2:])
    # After the view: a compiler else takes entities and batch apart number by number.
    return functional.leaky_relu(encoded)


def _attend(encoded: Tensor, asked: Tensor, there: Tensor | None) -> Tensor:
    """Attend to entities by heads; arguments as of `_weights`.

    Returns:
        (R, H, d, B).
    """
    weights = _weights(encoded, asked, there)
    pooled: Tensor = (weights.unsqueeze(2) * encoded).sum(dim=3)
    return pooled


def _weights(encoded: Tensor, asked: Tensor, there: Tensor | None) -> Tensor:
    """Weights on entities by heads.

    Args:
        encoded: (R, H, d, K, B) encodings of K entities.
        asked: (R, H, d, 1, B) queries, divided by sqrt(d).
        there: (R, K, B) bool, the entities that are there; None: all are.

    Returns:
        (R, H, K, B).
    """
    scores = (asked * encoded).sum(dim=2)  # (R, H, K, B)
    if there is None:
        return scores.softmax(dim=2)
    # The lowest finite number instead of -inf avoids NaN in a world without victims; the softmax
    # then gives equal weights, which the product sets to 0.
    seen = there.unsqueeze(1)
    scores = scores.masked_fill(~seen, torch.finfo(scores.dtype).min)
    return scores.softmax(dim=2) * seen


def batch_last_in_memory(obs: Tensor) -> Tensor:
    """The observations (R, B, D), in memory (R, D, B).

    An `EntityEncoder` reads them several times faster so, above all in a compiled update.
    """
    return obs.transpose(1, 2).contiguous().transpose(1, 2)


def _blocks(columns: Tensor, count: int) -> Tensor:
    """Bring the columns of ``count`` entities (R, B, count * n) to (R, n, count, B), a copy.

    Whatever reads one column of all entities, such as which are there, then reads along memory.
    """
    robots, batch, width = columns.shape
    return columns.view(robots, batch, count, width // count).permute(0, 3, 2, 1).contiguous()


def observation_encoder(
    num_robots: int,
    obs_width: int,
    out_width: int,
    generator: torch.Generator,
    entities: EntityColumns | None,
    extra_width: int = 0,
    pooling: str = "attention",
) -> PerRobotLinear | EntityEncoder:
    """A layer that maps (R, B, D + extra) to (R, B, out).

    Args:
        num_robots: R.
        obs_width: D.
        out_width: Outputs per robot.
        generator: Source of the initial parameters, on the CPU.
        entities: Columns of the entities to encode separately; None: encode the whole row.
        extra_width: Columns behind an observation.
        pooling: How `EntityEncoder` sums up entities.
    """
    if entities is None:
        return PerRobotLinear(num_robots, obs_width + extra_width, out_width, generator)
    return EntityEncoder(num_robots, entities, extra_width, out_width, generator, pooling)
