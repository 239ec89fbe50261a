"""Whether updates run as one compiled graph: what is asked for, what pays, what works here."""

from __future__ import annotations

import logging

import torch
from torch import Tensor

from innerattn.config import RunConfig

_log = logging.getLogger(__name__)

_WORTH_ROWS = 8_000_000
"""Rows of training from which compiling surely pays: the compiler takes up to a minute, and then
some 15 to 30 microseconds a row are saved (`benches/compare_learner.py`)."""


def compiles(config: RunConfig) -> bool:
    """Whether this run's updates are to be compiled here.

    Where it is wanted but cannot be, one line of the log says so.
    """
    choice = config.train.compile
    if choice == "off":
        return False
    worth = (
        config.train.device == "cpu"
        and config.algorithm.rows_of_training(config.train.env_steps) >= _WORTH_ROWS
    )
    if choice == "auto" and not worth:
        return False
    problem = _problem(config.train.device)
    if problem is not None:
        _log.warning("Updates run uncompiled, which is slower: no working compiler %s", problem)
    return problem is None


def _problem(device: str) -> str | None:
    """What keeps the compiler from working there, found by compiling a line; None where it works.

    A compiler alone is not enough: Python's headers, for one, are needed, too.
    """

    def line(x: Tensor) -> Tensor:
        return x.exp() + 1.0

    try:
        torch.compile(line)(torch.ones(8, device=device))
    except Exception as error:  # whatever a missing part of the tool chain raises
        reason = [text for text in str(error).splitlines() if text.strip()]
        return f"({reason[0] if reason else type(error).__name__})"
    return None
