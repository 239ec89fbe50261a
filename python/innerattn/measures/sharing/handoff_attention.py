"""A robot's attention to its two partners around handoffs, over many handoffs together.

A single chosen episode, as in Fig. 5, is an illustration; this is the evidence.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from innerattn.measures.sharing.handoff import REACH
from innerattn.records.record import Record
from innerattn.stats.clusters import ratio_intervals
from innerattn.stats.permutation import permutation_test

Array = NDArray[np.float64]

_PERMUTATIONS = 9_999


@dataclass(frozen=True)
class Attended:
    """The weight on one partner; K = 1 + H columns: the mean over heads, then each head.

    Attributes:
        weight: (3, W, K) float64 mean, low and high end by offset.
        change: (3, K) float64 mean, low and high end of the mean weight in the steps after the
            first rescue minus that in the steps up to it.
    """

    weight: Array
    change: Array


@dataclass(frozen=True)
class HandoffAttention:
    """Attention of the robots that hand over, aligned on the first rescue.

    Only steps of a handoff's own two stages count: none before `start`, none after `second`. The
    95 % intervals are over episodes, since handoffs of one episode share steps; NaN where
    less than two episodes have the offset.

    Attributes:
        handoffs: N.
        episodes: episodes they come from.
        offsets: (W,) int64 steps since the first rescue's; the action of offset 0 completes it, so
            offsets above 0 are those after it.
        counts: (W,) int64 handoffs with such a step.
        to_be: the partner of the second rescue.
        before: the partner of the first.
        p: two-sided, of the change on the partner to be minus that on the one before; of weights
            averaged over heads.
    """

    handoffs: int
    episodes: int
    offsets: NDArray[np.int64]
    counts: NDArray[np.int64]
    to_be: Attended
    before: Attended
    p: float


def handoff_attention(
    record: Record, handoffs: NDArray[np.void], seed: int, reach: int = REACH
) -> HandoffAttention | None:
    """How attention moves from one partner to the next.

    The p-value is of a permutation test: if attention does not depend on which of its two partners
    is next, they can be exchanged. Handoffs of one episode are not independent, so they are
    exchanged together. Teammates that are no partners are left out, since attention that passes
    from them to both partners alike does not move from one to the other. A change towards one
    partner whatever the work cancels only if handoffs in both orders are given.

    Attention may also pass on because other victims need other robots, whoever goes. As a control
    give the same handoffs with ``robot`` replaced by one that does nothing in their windows, see
    `handoff.rescues_nobody`.

    Args:
        record: with attention.
        handoffs: (N,) `handoff.HANDOFF` of this record, of any robots.
        seed: seed of the permutations.
        reach: steps on either side of the first rescue, W / 2.

    Returns:
        None where there is no handoff or the record has no attention.

    Raises:
        ValueError: reach is not positive, or a robot is its own partner.
    """
    if reach < 1:
        raise ValueError(f"reach = {reach}: must be 1 or more")
    partners = np.stack([handoffs["after"], handoffs["before"]])
    if (partners == handoffs["robot"]).any():
        raise ValueError("handoffs: a robot cannot be before or after itself")
    if not len(handoffs) or "attention" not in record.steps:
        return None
    offsets = np.arange(1 - reach, reach + 1)
    weights, counted = aligned_weights(record, handoffs, offsets)
    names, episode = np.unique(handoffs["episode"], return_inverse=True)
    changes = _mean(weights, counted & (offsets > 0)) - _mean(weights, counted & (offsets <= 0))
    roles = partners - (partners > handoffs["robot"])
    to_be, before = (Attended(*_curves(weights, counted, changes, role, episode)) for role in roles)
    on_next, on_last = (
        np.take_along_axis(changes, role[:, None, None], -1)[..., 0] for role in roles
    )
    return HandoffAttention(
        handoffs=len(handoffs),
        episodes=len(names),
        offsets=offsets,
        counts=counted.sum(0),
        to_be=to_be,
        before=before,
        p=_exchange_p((on_next - on_last)[:, 0], episode, seed),
    )


def aligned_weights(
    record: Record,
    handoffs: NDArray[np.void],
    offsets: NDArray[np.int64],
    field: str = "attention",
) -> tuple[Array, NDArray[np.bool_]]:
    """A robot's attention around its handoffs.

    Args:
        record: with ``field`` step by step.
        handoffs: (N,) `handoff.HANDOFF`.
        offsets: (W,) steps since the first rescue's.
        field: "attention", of the critic, or "actor_attention".

    Returns:
        (N, W, 1 + H, R - 1) float64 weights on teammates by index, the robot itself left out: their
        mean over heads, then each head; NaN outside the handoff's stages. (N, W) bool whether it
        is inside.
    """
    step = handoffs["first"][:, None] + offsets
    inside = (step >= handoffs["start"][:, None]) & (step <= handoffs["second"][:, None])
    attention = record.steps[field]
    robots = np.arange(attention.shape[-1])
    teammates = np.stack([np.delete(robots, robot) for robot in robots])
    robot = handoffs["robot"]
    episode = handoffs["episode"] - record.first_episode
    existing = np.where(inside, step, 0)
    heads = attention[episode[:, None], existing, :, robot[:, None]].astype(np.float64)
    heads = np.take_along_axis(heads, teammates[robot][:, None, None], -1)
    weights = np.concatenate([heads.mean(2, keepdims=True), heads], 2)
    return np.where(inside[..., None, None], weights, np.nan), inside


def _mean(weights: Array, chosen: NDArray[np.bool_]) -> Array:
    """Mean over the chosen of W steps, (N, K, R - 1); there is always one on either side."""
    total = np.where(chosen[..., None, None], weights, 0.0).sum(1)
    return np.asarray(total / chosen.sum(1)[:, None, None])


def _curves(
    weights: Array,
    counted: NDArray[np.bool_],
    changes: Array,
    role: NDArray[np.int64],
    episode: NDArray[np.int64],
) -> tuple[Array, Array]:
    """`Attended.weight` and `Attended.change` of the teammate in a role, an index for each of N."""
    weight = np.take_along_axis(weights, role[:, None, None, None], -1)[..., 0]
    change = np.take_along_axis(changes, role[:, None, None], -1)[..., 0]
    sums = _by_episode(np.where(counted[..., None], weight, 0.0), episode)
    steps = _by_episode(counted[..., None], episode)
    events = _by_episode(np.ones((len(role), 1)), episode)
    return (
        np.stack(ratio_intervals(sums, steps)),
        np.stack(ratio_intervals(_by_episode(change, episode), events)),
    )


def _by_episode(values: NDArray[np.generic], episode: NDArray[np.int64]) -> Array:
    """Sums over the handoffs of each episode."""
    sums = np.zeros((episode.max() + 1, *values.shape[1:]))
    np.add.at(sums, episode, values)
    return sums


def _exchange_p(differences: Array, episode: NDArray[np.int64], seed: int) -> float:
    """The p-value of the sum of differences (N,), whose signs an exchange of partners turns round.

    Args:
        differences: (N,) change on one partner minus that on the other.
        episode: (N,) from 0; the differences of an episode are turned round together.
        seed: seed of the exchanges.
    """

    def total(*samples: Array, axis: int) -> Array:
        return np.asarray(samples[0].sum(axis))

    sums = _by_episode(differences, episode)
    if len(sums) < 2:
        return 1.0  # with one sign there is nothing to compare with
    return permutation_test([sums], total, "samples", seed, _PERMUTATIONS).p
