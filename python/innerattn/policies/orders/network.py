"""The network of the learnt policy in numpy: it scores the tasks that could come next.

It is `innerattn.nn.orders.OrderNetwork`. Open tasks attend to each other, with a bias for how they
are related; nothing depends on how many there are.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from innerattn._core import ORDER_FEATURES
from innerattn.errors import RunError
from innerattn.policies.orders.relations import RELATIONS

Array = NDArray[np.float32]

HEADS = 4
LARGEST = np.float32(10)
"""Features are cut at this size."""
SHUT = np.float32(-1e9)
"""Logit of a task that is in the order already."""
_EPSILON = np.float32(1e-5)


def layer_shapes(width: int) -> Mapping[str, tuple[int, ...]]:
    """Shapes of all arrays by name, for hidden layers of this width."""
    linear = {
        "first": (width, ORDER_FEATURES),
        "second": (width, width),
        "attend": (3 * width, width),
        "relate": (HEADS, RELATIONS),
        "join": (width, width),
        "widen": (2 * width, width),
        "narrow": (width, 2 * width),
        "last": (width, width),
        "score": (1, width),
    }
    norms = ("attend_norm", "widen_norm", "last_norm")
    weights = {f"{name}.weight": shape for name, shape in linear.items()}
    biases = {f"{name}.bias": shape[:1] for name, shape in linear.items()}
    return (
        weights | biases | {f"{n}.{part}": (width,) for n in norms for part in ("weight", "bias")}
    )


class PlainOrderNetwork:
    """Scores of open tasks, by numpy alone."""

    def __init__(self, tensors: Mapping[str, Array]) -> None:
        """Take the arrays.

        Args:
            tensors: as `layer_shapes` says, for any width that the number of heads divides.

        Raises:
            RunError: an array is missing, unknown, or of another shape.
        """
        first = tensors.get("first.weight")
        width = first.shape[0] if first is not None and first.ndim == 2 else 0
        shapes = layer_shapes(width)
        if difference := shapes.keys() ^ tensors.keys():
            raise RunError(f"{min(difference)}: is missing or unknown")
        if width == 0 or width % HEADS:
            raise RunError(f"first.weight: has {width} rows: must be a multiple of {HEADS}")
        for name, shape in shapes.items():
            if tensors[name].shape != shape:
                raise RunError(f"{name}: has shape {tensors[name].shape}: must have {shape}")
        self.width = width
        self._tensors = dict(tensors)

    def scores(self, features: Array, relations: Array, is_open: NDArray[np.bool_]) -> Array:
        """Scores (B, T) of tasks; that of one in the order already is `SHUT`.

        Args:
            features: (B, T, F) of `_core.Orders.features`.
            relations: (B, T, T, 2) of `relations_of`.
            is_open: (B, T), whether a task could come next.
        """
        heads = (*features.shape[:2], 3, HEADS, self.width // HEADS)
        rows = self._relu("first", np.clip(features, -LARGEST, LARGEST))
        rows = self._linear("second", rows)
        asked = self._linear("attend", self._normed("attend_norm", rows)).reshape(heads)
        query, key, value = asked.transpose(2, 0, 3, 1, 4)
        logits = query @ key.swapaxes(-1, -2) * np.float32((self.width // HEADS) ** -0.5)
        logits += self._linear("relate", relations).transpose(0, 3, 1, 2)
        logits += np.where(is_open, np.float32(0), SHUT)[:, None, None, :]
        weights = np.exp(logits - logits.max(axis=-1, keepdims=True))
        weights /= weights.sum(axis=-1, keepdims=True)
        pooled = (weights @ value).swapaxes(1, 2).reshape(rows.shape)
        rows = rows + self._linear("join", pooled)
        wide = self._relu("widen", self._normed("widen_norm", rows))
        rows = rows + self._linear("narrow", wide)
        rows = self._relu("last", self._normed("last_norm", rows))
        return np.where(is_open, self._linear("score", rows)[..., 0], SHUT)

    def _linear(self, name: str, rows: Array) -> Array:
        found = rows @ self._tensors[f"{name}.weight"].T + self._tensors[f"{name}.bias"]
        return np.asarray(found, np.float32)

    def _relu(self, name: str, rows: Array) -> Array:
        return np.maximum(self._linear(name, rows), np.float32(0))

    def _normed(self, name: str, rows: Array) -> Array:
        centred = rows - rows.mean(axis=-1, keepdims=True)
        spread = np.sqrt((centred * centred).mean(axis=-1, keepdims=True) + _EPSILON)
        found = centred / spread * self._tensors[f"{name}.weight"] + self._tensors[f"{name}.bias"]
        return np.asarray(found, np.float32)
