"""What a part of training knows, as tensors by name, so that another process can go on from it.

A part gives a state and takes it back. These helpers check what is taken back: it may come from a
file that is damaged or hostile.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

import torch
from torch import Tensor

State = Mapping[str, Tensor]


class Resumable(Protocol):
    """A part of training that can go on in another process."""

    def resume_state(self) -> dict[str, Tensor]:
        """All that the part needs to go on, by name; tensors may be live."""

    def load_resume_state(self, state: State) -> None:
        """Go on from what `resume_state` gave to an equal part.

        Raises:
            ValueError: A tensor is missing, of another shape or dtype, or has a value that cannot
                be; the part is not to be used then.
        """


def under(name: str, state: State) -> dict[str, Tensor]:
    """The state of a part with ``name`` before its names."""
    return {f"{name}.{key}": value for key, value in state.items()}


def inside(name: str, state: State) -> dict[str, Tensor]:
    """The state of the part ``name``: what `under` was given."""
    first = f"{name}."
    return {key.removeprefix(first): value for key, value in state.items() if key.startswith(first)}


def take(state: State, name: str, dtype: torch.dtype, *shape: int | None) -> Tensor:
    """A tensor of a state.

    Args:
        state: By name.
        name: Of the tensor.
        dtype: That it must have.
        shape: That it must have; None: any size.

    Raises:
        ValueError: It is missing or other than that, or a value is not finite.
    """
    if name not in state:
        raise ValueError(f"has no {name!r}")
    found = state[name]
    fits = len(found.shape) == len(shape) and all(
        wanted in (None, size) for size, wanted in zip(found.shape, shape, strict=True)
    )
    if found.dtype != dtype or not fits:
        text = ", ".join("any" if size is None else str(size) for size in shape)
        raise ValueError(
            f"{name!r} is {found.dtype} {tuple(found.shape)}: must be {dtype} ({text})"
        )
    if not bool(found.isfinite().all()):
        raise ValueError(f"{name!r}: must be finite")
    return found


def take_within(
    state: State, name: str, dtype: torch.dtype, low: int, high: int, *shape: int | None
) -> Tensor:
    """As `take`, of whole numbers in ``low`` to ``high``.

    Raises:
        ValueError: As in `take`, or a number is out of range.
    """
    found = take(state, name, dtype, *shape)
    if found.numel() and not (low <= int(found.min()) and int(found.max()) <= high):
        raise ValueError(f"{name!r}: must be in {low}..={high}")
    return found


def whole(value: int) -> Tensor:
    """() int64, for a state."""
    return torch.tensor(value, dtype=torch.int64)


def take_whole(state: State, name: str, low: int = 0, high: int = 2**62) -> int:
    """A whole number of a state.

    Raises:
        ValueError: It is missing, none, or out of range.
    """
    return int(take_within(state, name, torch.int64, low, high))


def take_generator(state: State, name: str, generator: torch.Generator) -> None:
    """Let a random generator go on from the state that it had.

    Raises:
        ValueError: It is missing, or no state of such a generator.
    """
    found = take(state, name, torch.uint8, None)
    try:
        generator.set_state(found)
    except (RuntimeError, TypeError) as error:
        raise ValueError(f"{name!r}: is no state of a random generator") from error
