"""How a learner learns, in the midst of many updates, that training is to stop."""

from __future__ import annotations

from contextlib import AbstractContextManager, nullcontext
from typing import Protocol


class Interruptions(Protocol):
    """Requests to stop, which wait until somebody asks for them."""

    def check(self) -> None:
        """Raise a KeyboardInterrupt if there was a request; called between updates."""

    def at_once(self) -> AbstractContextManager[None]:
        """Let a request raise at any moment inside the block, which can take long."""


class NoInterruptions:
    """Nobody asks."""

    def check(self) -> None:
        """Raise nothing."""

    def at_once(self) -> AbstractContextManager[None]:
        """Change nothing."""
        return nullcontext()
