"""A robot's policy in numpy: an observation to the logits of its actions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import astuple

import numpy as np
from numpy.typing import NDArray

from innerattn.policies.exported.contract import Entities, Network
from innerattn.policies.exported.frame import Frame

Array = NDArray[np.float32]
_HEAD_WIDTH = 8
"""Width of an attention head of the entity encoder, as in `innerattn.nn.encoder`."""


class NumpyActor:
    """Two hidden layers after an encoder: the numbers of the trained actor, but for rounding."""

    def __init__(
        self,
        network: Network,
        tensors: Mapping[str, Array],
        width: int,
        outputs: int,
        frame: Frame | None,
    ) -> None:
        """Take the arrays of one actor.

        Args:
            network: what kind it is.
            tensors: weights (out, in) and biases (out,) by name of the layer.
            width: D.
            outputs: O, as `Contract.outputs`.
            frame: what observations are turned by first; None: nothing.

        Raises:
            ValueError: an array is missing, of another shape, or unknown.
        """
        shapes = layer_shapes(network, width, outputs)
        names = {f"{layer}.{part}" for layer in shapes for part in ("weight", "bias")}
        if difference := names ^ tensors.keys():
            raise ValueError(f"{min(difference)}: is missing or unknown")
        for layer, shape in shapes.items():
            found = (tensors[f"{layer}.weight"].shape, tensors[f"{layer}.bias"].shape)
            if found != (shape, shape[:1]):
                raise ValueError(f"{layer}: has shapes {found}, must have {(shape, shape[:1])}")
        # Transposed once: rows are multiplied from the left.
        self._layers = {
            layer: (np.ascontiguousarray(tensors[f"{layer}.weight"].T), tensors[f"{layer}.bias"])
            for layer in shapes
        }
        self._slope = np.float32(network.leaky_relu_slope)
        self._entities, self._pooling = network.entities, network.pooling
        self._frame = frame
        self._log_std = network.log_std

    def logits(self, rows: Array) -> Array:
        """Map observations (B, D) float32 to outputs (B, O) float32 for the world's actions."""
        with np.errstate(over="ignore", invalid="ignore"):  # what is not finite is refused later
            if self._frame is None:
                return self._forward(rows)
            elements = self._frame.elements(rows)
            return self._frame.turn_back(self._forward(self._frame.turn(rows, elements)), elements)

    def _forward(self, rows: Array) -> Array:
        if self._entities is None:
            hidden = self._linear("first", rows)
        else:
            hidden = self._encode(rows, self._entities)
        hidden = self._linear("second", self._relu(hidden))
        outputs = self._linear("output", self._relu(hidden))
        if self._log_std is not None:
            low, high, shift = astuple(self._log_std)
            half = np.tanh((outputs[:, 2:] + np.float32(shift)) * np.float32(0.5))
            outputs[:, 2:] = np.float32(low) + np.float32((high - low) / 2) * (half + 1)
        return outputs

    def _encode(self, rows: Array, columns: Entities) -> Array:
        """The entity encoder; see `innerattn.nn.EntityEncoder`."""
        count = len(rows)
        ends = np.cumsum([columns.own, columns.teammates * columns.teammate])
        own, teammates, victims = np.split(rows, ends, axis=1)
        own = self._relu(self._linear("first.own", own))
        both: Sequence[Array | None] = (None, None)
        if self._pooling == "attention":
            queries = self._linear("first.query", own) * np.float32(_HEAD_WIDTH**-0.5)
            width = own.shape[1]
            both = queries[:, :width], queries[:, width:]
        blocks = victims.reshape(count, columns.victims, columns.victim)
        there = blocks[:, :, columns.present] > 0.5
        place = columns.victim_place
        parts = [own, self._pool("first.victim", blocks, there, place, both[0])]
        if columns.teammates:
            blocks = teammates.reshape(count, columns.teammates, columns.teammate)
            known, place = self._known(blocks, columns), columns.teammate_place
            parts.append(self._pool("first.teammate", blocks, known, place, both[1]))
        return self._linear("first.output", np.concatenate(parts, axis=1))

    def _known(self, teammates: Array, columns: Entities) -> NDArray[np.bool_]:
        """Which teammates (B, K, n) are there: (B, K)."""
        known: NDArray[np.bool_]
        if columns.seen is not None:
            known = teammates[:, :, columns.seen] > 0.5
        elif self._pooling == "attention":
            known = np.ones(teammates.shape[:2], np.bool_)
        else:
            known = (teammates != 0.0).any(axis=2)
        return known

    def _pool(
        self,
        layer: str,
        blocks: Array,
        there: NDArray[np.bool_],
        place: tuple[int, int] | None,
        queries: Array | None,
    ) -> Array:
        """Sum up the entities (B, K, n) that are there (B, K), by queries (B, W): (B, W)."""
        encoded = self._relu(self._linear(layer, blocks))
        if queries is not None:
            return self._attend(encoded, there, queries)
        seen = there[:, :, None]
        pooled: Array
        if self._pooling == "max":
            largest = np.where(seen, encoded, np.finfo(np.float32).min).max(axis=1)
            pooled = np.where(seen.any(axis=1), largest, np.float32(0.0))
        elif self._pooling == "nearest":
            assert place is not None  # as `layer_shapes` checks
            x, y = (blocks[:, :, axis] for axis in place)
            nearest = np.where(there, x * x + y * y, np.inf).argmin(axis=1)
            rows = np.arange(len(blocks))
            pooled = encoded[rows, nearest] * seen[rows, nearest]
        else:
            number = np.maximum(seen.sum(axis=1, keepdims=True), 1).astype(np.float32)
            pooled = (seen / number * encoded).sum(axis=1)
        return pooled

    def _attend(self, encoded: Array, there: NDArray[np.bool_], queries: Array) -> Array:
        """Attend to encodings (B, K, W)."""
        encoded = encoded.reshape(*encoded.shape[:2], -1, _HEAD_WIDTH)
        asked = queries.reshape(len(encoded), 1, -1, _HEAD_WIDTH)
        scores = (asked * encoded).sum(axis=3)  # (B, K, H)
        scores = np.where(there[:, :, None], scores, np.finfo(np.float32).min)
        weights = _softmax(scores, axis=1) * there[:, :, None]
        pooled: Array = (weights[..., None] * encoded).sum(axis=1).reshape(len(encoded), -1)
        return pooled

    def _linear(self, layer: str, rows: Array) -> Array:
        weight, bias = self._layers[layer]
        outputs: Array = rows @ weight + bias
        return outputs

    def _relu(self, values: Array) -> Array:
        found: Array = np.maximum(values, values * self._slope)  # as the slope is below 1
        return found


def layer_shapes(network: Network, width: int, outputs: int) -> dict[str, tuple[int, int]]:
    """Shape (out, in) of the weights of each layer, by its name.

    Raises:
        ValueError: the network's encoder and its columns do not fit.
    """
    hidden = network.hidden_width
    rest = {"second": (hidden, hidden), "output": (outputs, hidden)}
    columns = network.entities
    if (network.encoder == "entities") != (columns is not None):
        raise ValueError("network.entities: must be there for the encoder 'entities' alone")
    if network.pooling != "attention" and columns is None:
        raise ValueError("network.pooling: must be 'attention' for the encoder 'flat'")
    if columns is None:
        return {"first": (hidden, width)} | rest
    of_teammates = columns.teammates * columns.teammate
    if columns.own + of_teammates + columns.victims * columns.victim != width:
        raise ValueError(f"network.entities: must have {width} columns")
    _check_indices(columns, network.pooling)
    inside = max(1, hidden // (4 * _HEAD_WIDTH)) * _HEAD_WIDTH
    pools = 2 if columns.teammates else 1
    first = {
        "first.own": (inside, columns.own),
        "first.victim": (inside, columns.victim),
        "first.output": (hidden, (1 + pools) * inside),
    }
    if network.pooling == "attention":
        first["first.query"] = (pools * inside, inside)
    if columns.teammates:
        first["first.teammate"] = (inside, columns.teammate)
    return first | rest


def _check_indices(columns: Entities, pooling: str) -> None:
    """Refuse columns of an entity that it does not have."""
    pooled = [("victim", columns.victim, [columns.present], columns.victim_place)]
    if columns.teammates:
        seen = [] if columns.seen is None else [columns.seen]
        pooled.append(("teammate", columns.teammate, seen, columns.teammate_place))
    for entity, width, flags, place in pooled:
        if pooling == "nearest" and place is None:
            raise ValueError(f"network.entities.{entity}_place: is missing")
        if (last := max([*flags, *(place or ())], default=-1)) >= width:
            raise ValueError(f"network.entities: a {entity} has {width} columns, not column {last}")


def probabilities_of(logits: Array) -> Array:
    """The softmax of logits (B, A)."""
    return _softmax(logits, axis=1)


def _softmax(values: Array, axis: int) -> Array:
    powers = np.exp(values - values.max(axis=axis, keepdims=True))
    softmax: Array = powers / powers.sum(axis=axis, keepdims=True)
    return softmax
