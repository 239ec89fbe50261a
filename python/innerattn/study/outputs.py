"""What a study makes of its finished runs: tables and figures, none so far."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from innerattn.study.inventory import FinishedRun


def make_outputs(
    target: str, runs: Sequence[FinishedRun], out: Path, *, note: str | None = None
) -> list[Path]:
    """Make what was asked for.

    Args:
        target: one of `innerattn.study.plan.TARGETS`.
        runs: the finished runs; where some failed or were left out, fewer than planned.
        out: folder of the study.
        note: what every output must say about the runs; none: nothing.

    Returns:
        The files that were written.
    """
    del target, runs, out, note
    return []
