"""Decides whether updates run as one compiled graph: as asked, if it pays, and if it works here."""

from __future__ import annotations

import logging

import torch
from torch import Tensor

from innerattn.config import RunConfig
from innerattn.learn.compiled import first_line

_log = logging.getLogger(__name__)

_WORTH_ROWS = 8_000_000
"""Rows of training from which compiling pays: the compiler takes up to a minute, and compiled
updates save about 15 to 30 microseconds a row (`benches/compare_learner.py`)."""


def compiles(config: RunConfig) -> bool:
    """Whether to compile the updates of this run.

    Those of networks with a memory never are: to compile their sequences, which are unrolled, takes
    longer than it saves in trainings of minutes.
    If they should be compiled and there is no working compiler, a warning says so.
    """
    choice = config.train.compile
    if choice == "off" or config.network.memory_width:
        return False
    worth = (
        config.train.device == "cpu"
        and config.algorithm.rows_of_training(config.train.env_steps) >= _WORTH_ROWS
    )
    if choice == "auto" and not worth:
        return False
    problem = _problem(config.train.device)
    if problem is not None:
        say_uncompiled(f"no working compiler {problem}")
    return problem is None


def say_uncompiled(why: str) -> None:
    """Warn that updates are not compiled, though they should be."""
    _log.warning("Updates run uncompiled, which is slower: %s", why)


def _problem(device: str) -> str | None:
    """Why compiling fails there, found by compiling one line; None if it works.

    A compiler alone is not enough: Python's headers, for example, are needed too.
    """

    def line(x: Tensor) -> Tensor:
        return x.exp() + 1.0

    try:
        torch.compile(line)(torch.ones(8, device=device))
    except Exception as error:  # whatever a missing part of the tool chain raises
        return f"({first_line(error)})"
    return None
