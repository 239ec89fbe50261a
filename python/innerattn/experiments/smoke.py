"""Which studies are smoke runs, too short for any number to mean something."""

from __future__ import annotations


def smoke_note(budget: str) -> str | None:
    """What every output of a study says whose runs are too short to mean anything; none else."""
    if budget != "quick":
        return None
    return "budget quick: a smoke run, no result; its runs are too short to compare methods"
