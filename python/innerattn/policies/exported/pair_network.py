"""The policy for any team in numpy: each pair proposes an action, and a softmax over them decides.

It is `innerattn.nn.teams.actor` for one robot, which looks at its own row alone.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import exp, log, nan

import numpy as np
from numpy.typing import NDArray

from innerattn.policies.exported.contract import Contract, Network
from innerattn.policies.exported.pairs import (
    HOME_WIDTH,
    PAIR_WIDTH,
    TURNING_WIDTH,
    Home,
    Mask,
    Pairs,
    Relating,
)
from innerattn.policies.exported.table import TableReader, too_large

Array = NDArray[np.float32]

_ACTIONS = 5
_HOME_HIDDEN = 32
_ZERO, _SHARPNESS, _LARGEST_LOGIT, _ALMOST_NOTHING = (
    np.array(value, np.float32) for value in (0.0, 10.0, 20.0, 1e-9)
)
_NO_BIAS = np.zeros(1, np.float32)
_ROUNDS = ("", "_again")
"""Suffixes of the poolings' names in the first and the second round."""


class PairLayers:
    """The arrays of the network, which all robots share."""

    def __init__(self, network: Network, tensors: Mapping[str, Array]) -> None:
        """Take the arrays.

        Args:
            network: what kind it is.
            tensors: weights (out, in) and biases (out,) by name of the layer.

        Raises:
            ValueError: an array is missing, of another shape, or unknown.
        """
        shapes = pair_shapes(network)
        if difference := shapes.keys() ^ tensors.keys():
            raise ValueError(f"{min(difference)}: is missing or unknown")
        for name, shape in shapes.items():
            if tensors[name].shape != shape:
                raise ValueError(f"{name}: has shape {tensors[name].shape}, must have {shape}")
        self.width, self.pooling = network.hidden_width, network.pooling
        # Transposed once: rows are multiplied from the left.
        self._layers: dict[str, tuple[Array, Array]] = {}
        for name in shapes:
            layer, _, part = name.rpartition(".")
            if part == "weight":
                bias = tensors.get(f"{layer}.bias", _NO_BIAS)
                self._layers[layer] = (np.ascontiguousarray(tensors[name].T), bias)
        if self.pooling == "attention":
            self._join_poolings(network)

    def _join_poolings(self, network: Network) -> None:
        """Ask rivals and partners at once: put queries and keys of both side by side."""
        assert network.pairs is not None  # as the shapes need it
        scale = np.float32(network.pairs.key_width**-0.5)
        for suffix in _ROUNDS:
            asked, known = (
                [self._layers.pop(f"{who}{suffix}.{part}") for who in ("rivals", "partners")]
                for part in ("query", "key")
            )
            weights, biases = (np.concatenate(parts, axis=-1) * scale for parts in zip(*asked))
            self._layers[f"query{suffix}"] = (weights, biases)
            keys = np.concatenate([one for one, _ in known], axis=1)
            self._layers[f"key{suffix}"] = (keys, _NO_BIAS)

    def linear(self, layer: str, rows: Array) -> Array:
        """A layer of rows (P, in): (P, out)."""
        weight, bias = self._layers[layer]
        found: Array = rows.dot(weight)
        found += bias
        return found

    def relu(self, layer: str, rows: Array) -> Array:
        """A layer of rows and what is above 0 of it."""
        found = self.linear(layer, rows)
        np.maximum(found, _ZERO, out=found)
        return found


class PairActor:
    """The policy of one robot of a team; see `innerattn.policies.exported.backend.Actor`."""

    def __init__(self, contract: Contract, robot: int, layers: PairLayers) -> None:
        """Prepare for a robot.

        Args:
            contract: of the team.
            robot: its number there.
            layers: of the policy.

        Raises:
            ValueError: the columns of the contract are not those of its team.
        """
        self._reader = TableReader(contract, robot)
        self._relating = Relating(contract, self._reader.order)
        self._layers = layers

    def logits(self, rows: Array) -> Array:
        """Map observations (B, D) float32 to log-probabilities (B, 5) of the world's actions."""
        found = [self._log_probabilities(row) for row in rows]
        return np.array(found, np.float32).reshape(-1, _ACTIONS)

    def _log_probabilities(self, row: Array) -> list[float]:
        if too_large(row):
            return [nan] * _ACTIONS
        pairs, home = self._relating.relate(self._reader.table(row))
        if pairs is None:
            nothing = np.zeros(self._layers.width, np.float32)
            return mixture([self._at_home(home, nothing)], [home.frame])
        proposed, own = self._proposed(pairs)
        proposals = [*proposed.tolist(), self._at_home(home, own)]
        return mixture(proposals, [*pairs.frames, home.frame])

    def _proposed(self, pairs: Pairs) -> tuple[Array, Array]:
        """Weight and actions (m, 6) of each own pair, and what the robot makes of all (H,)."""
        layers, width = self._layers, self._layers.width
        victims, robots = pairs.times.shape
        flat = pairs.columns.reshape(victims * robots, PAIR_WIDTH)
        both = np.empty((victims, robots, 2 * width), np.float32)
        rows = both[..., :width]
        rows[:] = layers.relu("first", flat).reshape(rows.shape)
        rows *= pairs.there
        both[..., width:] = rows.max(axis=0)
        rows = layers.relu("second", both.reshape(len(flat), -1)).reshape(rows.shape)
        rows *= pairs.there

        # From here on the robot's own victims count, first for all robots there.
        count, times = len(pairs.at), pairs.times.take(pairs.at, axis=0)
        parts = np.empty((count, robots, 4 * width), np.float32)
        parts[..., 3 * width :] = rows.max(axis=0)
        at = parts[..., :width]
        at[:] = rows.take(pairs.at, axis=0)
        pooled = self._pooled(_ROUNDS[0], at, at, pairs.masks, times)
        parts[..., width : 3 * width] = pooled.reshape(count, robots, -1)
        at = layers.relu("third", parts.reshape(count * robots, -1)).reshape(at.shape)
        at *= pairs.there.take(pairs.at, axis=0)

        begin = PAIR_WIDTH + TURNING_WIDTH
        mine = at[:, 0]
        own: Array = mine.max(axis=0)
        parts = np.empty((count, begin + 4 * width), np.float32)
        parts[:, :PAIR_WIDTH] = pairs.columns.take(pairs.at, axis=0)[:, 0]
        parts[:, PAIR_WIDTH:begin] = pairs.turning
        parts[:, begin : begin + width] = mine
        pooled = self._pooled(_ROUNDS[1], at[:, :1], at, pairs.masks[:, :, :1], times)
        parts[:, begin + width : begin + 3 * width] = pooled.reshape(count, -1)
        parts[:, begin + 3 * width :] = own
        rows = layers.relu("fourth", parts)
        return layers.linear("out", layers.relu("fifth", rows)) * _SHARPNESS, own

    def _pooled(self, suffix: str, asking: Array, at: Array, masks: Mask, times: Array) -> Array:
        """What pairs make of rivals and of partners at their victims: (m, Q, 2, H).

        Args:
            suffix: of the round, one of `_ROUNDS`.
            asking: (m, Q, H) the pairs.
            at: (m, R, H) all pairs at these victims; zeros where there is none.
            masks: (m, 2, Q, R) whom they look at.
            times: (m, R) arrival times.
        """
        pooling = self._layers.pooling
        count, robots, width = at.shape
        found: Array
        if pooling == "attention":
            query = self._layers.linear(f"query{suffix}", asking.reshape(-1, width))
            keys = self._layers.linear(f"key{suffix}", at.reshape(-1, width))
            query = query.reshape(count, -1, 2, query.shape[1] // 2).transpose(0, 2, 1, 3)
            keys = keys.reshape(count, robots, 2, -1).transpose(0, 2, 3, 1)
            weights = np.exp(np.minimum(query @ keys, _LARGEST_LOGIT)) * masks
            weights /= weights.sum(axis=3, keepdims=True) + _ALMOST_NOTHING
            found = weights @ at[:, None]
        elif pooling == "mean":
            number = np.maximum(masks.sum(axis=3, keepdims=True), 1)
            found = (masks / number).astype(np.float32) @ at[:, None]
        elif pooling == "max":  # what is pooled is at least 0
            found = (at[:, None, None] * masks[..., None]).max(axis=3)
        else:
            soonest = np.where(masks, times[:, None, None], np.float32(np.inf)).argmin(axis=3)
            found = at[np.arange(count)[:, None, None], soonest]
            found = found * masks.any(axis=3, keepdims=True)
        return found.transpose(0, 2, 1, 3)

    def _at_home(self, home: Home, own: Array) -> list[float]:
        """Weight and actions (6) of the way to the centre."""
        row = np.empty((1, HOME_WIDTH + self._layers.width), np.float32)
        row[0, :HOME_WIDTH] = home.columns
        row[0, HOME_WIDTH:] = own
        out = self._layers.linear("home_out", self._layers.relu("home", row))
        found: list[float] = (out[0] * _SHARPNESS).tolist()
        return found


def mixture(proposals: Sequence[Sequence[float]], frames: Sequence[int]) -> list[float]:
    """Log-probabilities (5) of actions in the world.

    Args:
        proposals: of each, its weight's logarithm and those of its actions, but for constants.
        frames: in which each is.
    """
    total = _log_sum([one[0] for one in proposals])
    rows = []
    for (weight, *choices), frame in zip(proposals, frames):
        rest = weight - total - _log_sum(choices)
        rows.append([choices[name] + rest for name in ACTION_NAMES[frame]])
    return [_log_sum(column) for column in zip(*rows)]


def _log_sum(values: Sequence[float]) -> float:
    """The logarithm of the sum of exponentials."""
    largest = max(values)
    return largest + log(sum([exp(value - largest) for value in values]))


def _names(frame: int) -> list[int]:
    """What stay, +x, -x, +y and -y of the world are called in a frame."""
    stay, right, left, up, down = [0, 3, 4, 1, 2] if frame & 4 else [0, 1, 2, 3, 4]
    if frame & 1:
        right, left = left, right
    if frame & 2:
        up, down = down, up
    return [stay, right, left, up, down]


ACTION_NAMES = [_names(frame) for frame in range(8)]
"""Of each frame; see `_names`."""


def pair_shapes(network: Network) -> dict[str, tuple[int, ...]]:
    """The shape of each array, weights as (out, in), by its name.

    Raises:
        ValueError: the network is not one of pairs.
    """
    if network.pairs is None:
        raise ValueError("network.pairs: is missing")
    width, keys = network.hidden_width, network.pairs.key_width
    layers = {
        "first": (width, PAIR_WIDTH),
        "second": (width, 2 * width),
        "third": (width, 4 * width),
        "fourth": (width, PAIR_WIDTH + TURNING_WIDTH + 4 * width),
        "fifth": (width, width),
        "out": (1 + _ACTIONS, width),
        "home": (_HOME_HIDDEN, HOME_WIDTH + width),
        "home_out": (1 + _ACTIONS, _HOME_HIDDEN),
    }
    shapes: dict[str, tuple[int, ...]] = {}
    if network.pooling == "attention":
        pools = [f"{who}{suffix}" for who in ("rivals", "partners") for suffix in _ROUNDS]
        layers |= {f"{pool}.query": (keys, width) for pool in pools}
        shapes |= {f"{pool}.key.weight": (keys, width) for pool in pools}
    for layer, shape in layers.items():
        shapes[f"{layer}.weight"], shapes[f"{layer}.bias"] = shape, shape[:1]
    return shapes
