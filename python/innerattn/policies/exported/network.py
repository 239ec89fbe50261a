"""A robot's policy in numpy: an observation to the logits of its actions."""

from __future__ import annotations

from collections.abc import Mapping
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
        self._entities = network.entities
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
        queries = self._linear("first.query", own) * np.float32(_HEAD_WIDTH**-0.5)
        width = own.shape[1]
        blocks = victims.reshape(count, columns.victims, columns.victim)
        present = blocks[:, :, columns.present] > 0.5
        parts = [own, self._pool("first.victim", blocks, queries[:, :width], present)]
        if columns.teammates:
            blocks = teammates.reshape(count, columns.teammates, columns.teammate)
            parts.append(self._pool("first.teammate", blocks, queries[:, width:], None))
        return self._linear("first.output", np.concatenate(parts, axis=1))

    def _pool(
        self, layer: str, blocks: Array, queries: Array, present: NDArray[np.bool_] | None
    ) -> Array:
        """Attend to entities (B, K, n) with queries (B, W): (B, W)."""
        encoded = self._relu(self._linear(layer, blocks))
        encoded = encoded.reshape(*blocks.shape[:2], -1, _HEAD_WIDTH)
        asked = queries.reshape(len(blocks), 1, -1, _HEAD_WIDTH)
        scores = (asked * encoded).sum(axis=3)  # (B, K, H)
        if present is not None:
            scores = np.where(present[:, :, None], scores, np.finfo(np.float32).min)
        weights = _softmax(scores, axis=1)
        if present is not None:
            weights = weights * present[:, :, None]
        pooled: Array = (weights[..., None] * encoded).sum(axis=1).reshape(len(blocks), -1)
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
    if columns is None:
        return {"first": (hidden, width)} | rest
    of_teammates = columns.teammates * columns.teammate
    if columns.own + of_teammates + columns.victims * columns.victim != width:
        raise ValueError(f"network.entities: must have {width} columns")
    inside = max(1, hidden // (4 * _HEAD_WIDTH)) * _HEAD_WIDTH
    pools = 2 if columns.teammates else 1
    first = {
        "first.own": (inside, columns.own),
        "first.victim": (inside, columns.victim),
        "first.query": (pools * inside, inside),
        "first.output": (hidden, (1 + pools) * inside),
    }
    if columns.teammates:
        first["first.teammate"] = (inside, columns.teammate)
    return first | rest


def probabilities_of(logits: Array) -> Array:
    """The softmax of logits (B, A)."""
    return _softmax(logits, axis=1)


def _softmax(values: Array, axis: int) -> Array:
    powers = np.exp(values - values.max(axis=axis, keepdims=True))
    softmax: Array = powers / powers.sum(axis=axis, keepdims=True)
    return softmax
