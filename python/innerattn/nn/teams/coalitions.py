"""When enough different robots could be at a victim, with one of them or without.

A robot fills one need of a victim at most, even where it could fill either of two. So many needs as
a set A of robots can fill together is, by Hall's theorem, the least over sets S of needs of: robots
of A that can fill a need in S, plus the robots needed for all other needs.
"""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor
from torch.nn import functional

NEVER_S = 1e3
"""Arrival time of nobody [s]."""


class Coalitions(NamedTuple):
    """What R robots mean to M victims.

    Attributes:
        first: (M,) when the first useful robot could be there [s].
        complete: (M,) when enough different robots could be there [s].
        without: (M, R) from when on others fill all that this robot could fill [s].
        others: (M, R) when enough others could be there to complete this robot [s].
        met: (M,) how many needs the robots inside fill.
        spare: (M,) useful robots minus needed ones, for the scarcest set of needs.
        spare_mine: (M, R) the same among sets with a need that this robot can fill; 5 if none.
    """

    first: Tensor
    complete: Tensor
    without: Tensor
    others: Tensor
    met: Tensor
    spare: Tensor
    spare_mine: Tensor


def coalitions(times: Tensor, inside: Tensor, needed: Tensor, fills: Tensor) -> Coalitions:
    """Look at M victims and R robots.

    Args:
        times: (M, R) arrival times [s].
        inside: (M, R) bool, who is there and useful.
        needed: (M, K) how many robots with each ability a victim needs.
        fills: (M, R, K), 1 where a robot can fill a need, else 0.
    """
    sets, units = _sets_of_needs(needed)
    useful = (torch.einsum("mrk,smk->smr", fills, sets) > 0.0).float()
    count = needed.sum(-1)
    elsewhere = count - units  # (S, M)
    order = times.argsort(dim=1, stable=True)
    arrived = useful.gather(2, order.expand_as(useful)).cumsum(2)
    room = functional.pad(arrived, (1, 0)) + elsewhere[..., None]  # (S, M, 1 + R)
    moments = functional.pad(times.gather(1, order), (1, 0))
    place = torch.empty_like(order).scatter_(
        1, order, torch.arange(order.shape[1]).expand_as(order)
    )
    here = (place[..., None] < torch.arange(order.shape[1] + 1)).float()  # (M, R, 1 + R)
    away = 1.0 - here
    with_me = without_me = torch.full_like(here, torch.inf)
    for mine, around in zip(useful[..., None], room[:, :, None], strict=True):
        with_me = torch.minimum(with_me, torch.addcmul(around, mine, away))
        without_me = torch.minimum(without_me, torch.addcmul(around, mine, here, value=-1))
    filled = room.amin(0)
    gap = torch.where(units > 0.0, useful.sum(2) - units, 5.0)
    gap_mine = torch.where(useful > 0.0, gap[..., None], 5.0)
    met = (torch.einsum("mr,smr->sm", inside.float(), useful) + elsewhere).amin(0)

    def since(holds: Tensor) -> Tensor:
        when = moments.view(len(holds), *(1,) * (holds.dim() - 2), holds.shape[-1])
        return torch.where(holds, when, NEVER_S).amin(-1)

    return Coalitions(
        first=since(filled >= 1.0),
        complete=since(filled >= count[:, None]),
        without=since(with_me == without_me),
        others=since(with_me >= count[:, None, None]),
        met=met,
        spare=gap.amin(0),
        spare_mine=gap_mine.amin(0),
    )


def _sets_of_needs(needed: Tensor) -> tuple[Tensor, Tensor]:
    """Sets of needs (S, M, K), 1 where a need belongs to it, and the robots they need (S, M)."""
    wanted = (needed > 0.0).float()
    sorts = wanted.argsort(dim=1, descending=True, stable=True)
    most = int(wanted.sum(1).amax()) if len(wanted) else 0
    chosen = (torch.arange(2**most)[:, None] >> torch.arange(most) & 1).float()  # (S, sorts)
    sizes = (len(chosen), len(needed), most)
    sets = torch.zeros(*sizes[:2], needed.shape[1])
    sets.scatter_(2, sorts[:, :most].expand(sizes), chosen[:, None].expand(sizes))
    sets = sets * wanted
    return sets, torch.einsum("smk,mk->sm", sets, needed)
