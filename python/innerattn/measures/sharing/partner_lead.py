"""How much more a robot attends to its next partner than to its last one, around handoffs."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
from numpy.typing import NDArray

from innerattn.measures.sharing.handoff_attention import aligned_weights
from innerattn.records.record import Record

BEFORE, AFTER = (-2, -1, 0), (1, 2, 3)
"""Steps since the first rescue's that a lead before and after it is a mean over."""


def partner_leads(
    record: Record, handoffs: NDArray[np.void], offsets: NDArray[np.int64], field: str
) -> NDArray[np.float64]:
    """A robot's weight on its next partner minus that on its last one, averaged over heads.

    Args:
        record: with ``field`` step by step.
        handoffs: (N,) `handoff.HANDOFF` of this record. A control is given as the same handoffs
            with another ``robot``, which is neither ``before`` nor ``after``.
        offsets: (W,) steps since the first rescue's.
        field: "attention" or "actor_attention".

    Returns:
        (N, W), in -1 to 1; NaN outside the handoff's own two stages.
    """
    weights, _ = aligned_weights(record, handoffs, offsets, field)
    on_next, on_last = (
        np.take_along_axis(weights[:, :, 0], _place(handoffs, role)[:, None, None], 2)[..., 0]
        for role in ("after", "before")
    )
    return np.asarray(on_next - on_last)


def _place(handoffs: NDArray[np.void], role: str) -> NDArray[np.int64]:
    """Index of a partner among the teammates, which the robot itself is none of."""
    return np.asarray(handoffs[role] - (handoffs[role] > handoffs["robot"]))


def mean_lead(
    leads: NDArray[np.float64], offsets: NDArray[np.int64], chosen: Collection[int]
) -> float | None:
    """The mean over handoffs, each of which counts with the mean over its own steps.

    Args:
        leads: (N, W) of `partner_leads`.
        offsets: (W,) the same as there.
        chosen: those of them that count.

    Returns:
        None where no handoff has such a step.
    """
    steps = leads[:, np.isin(offsets, list(chosen))]
    known = np.isfinite(steps)
    of_some = known.any(1)
    if not of_some.any():
        return None
    sums = np.where(known, steps, 0.0).sum(1)[of_some]
    return float((sums / known.sum(1)[of_some]).mean())
