"""Who can help whom, and with whom: what follows from needs and abilities, wherever robots are.

A robot fills one need of a victim at most, even where it could fill either of two. So many needs as
robots can fill together is, by Hall's theorem, the least over sets S of needs of: robots that can
fill a need in S, plus the robots needed for all other needs.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float32]
Mask = NDArray[np.bool_]


class Roles(NamedTuple):
    """What M victims need of R robots, over S sets of needs.

    Attributes:
        useful: (M, R) who can fill a need.
        useful_in: (S, M, R) float32, 1 where a robot can fill a need in a set.
        elsewhere: (S, M) float32, robots needed for all needs outside of a set.
        needed: (M,) float32, robots needed.
        filled_by: (M, R) float32, how many needs a robot could fill.
        spare: (M,) float32, useful robots minus needed ones, for the scarcest set of needs.
        spare_mine: (M, R) float32, the same among sets with a need that this robot can fill; 5 if
            there is none.
        rivals: (M, R, R), who could take whose part.
        partners: (M, R, R), who completes whom.
    """

    useful: Mask
    useful_in: Array
    elsewhere: Array
    needed: Array
    filled_by: Array
    spare: Array
    spare_mine: Array
    rivals: Mask
    partners: Mask


def roles_of(needs: Array, abilities: Array) -> Roles:
    """The roles of R robots with abilities (R, K) at victims with needs (M, K)."""
    fills = abilities * (needs > 0.0)[:, None]
    useful = np.asarray(fills.any(axis=2))
    sets, units = _sets_of_needs(needs)
    useful_in = (np.einsum("mrk,smk->smr", fills, sets) > 0.0).astype(np.float32)
    needed: Array = needs.sum(axis=1)
    gap = np.where(units > 0.0, useful_in.sum(axis=2) - units, np.float32(5.0))
    gap_mine = np.where(useful_in > 0.0, gap[..., None], np.float32(5.0))
    turned = fills.transpose(0, 2, 1)
    others = ~np.eye(len(abilities), dtype=np.bool_)
    # Two robots fill two needs where the needs that either can fill are two or more.
    filled = fills * needs[:, None]
    mine = filled.sum(axis=2)
    either = mine[:, :, None] + mine[:, None] - filled @ turned
    return Roles(
        useful=useful,
        useful_in=useful_in,
        elsewhere=needed - units,
        needed=needed,
        filled_by=fills.sum(axis=2),
        spare=gap.min(axis=0),
        spare_mine=gap_mine.min(axis=0),
        rivals=(fills @ turned > 0.0) & others,
        partners=useful[:, :, None] & useful[:, None] & others & (either > 1.0),
    )


def _sets_of_needs(needs: Array) -> tuple[Array, Array]:
    """Sets of needs (S, M, K), 1 where a need belongs to it, and the robots they need (S, M)."""
    wanted = [np.flatnonzero(one > 0.0) for one in needs]
    most = max(map(len, wanted))
    chosen = (np.arange(2**most)[:, None] >> np.arange(most) & 1).astype(np.float32)
    sets = np.zeros((len(chosen), *needs.shape), np.float32)
    for victim, sorts in enumerate(wanted):
        sets[:, victim, sorts] = chosen[:, : len(sorts)]
    units: Array = (sets * needs).sum(axis=2)
    return sets, units
