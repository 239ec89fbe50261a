"""A copy of tensors from before an update, so that an update that fails changes none of them."""

from __future__ import annotations

from collections.abc import Iterable

import torch
from torch import Tensor


class Undo:
    """Brings tensors back to what they were."""

    def __init__(self, tensors: Iterable[Tensor]) -> None:
        """Watch over tensors that are changed in place.

        Args:
            tensors: Of any shapes and dtypes; they must stay the same objects.
        """
        self._live = [tensor.detach() for tensor in tensors]
        self._kept = [torch.empty_like(tensor) for tensor in self._live]

    def keep(self) -> None:
        """Remember the values of now, in the place of earlier ones."""
        torch._foreach_copy_(self._kept, self._live)

    def restore(self) -> None:
        """Write back the values of the last `keep`."""
        torch._foreach_copy_(self._live, self._kept)
