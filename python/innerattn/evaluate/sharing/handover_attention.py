"""Does attention pass on with the work? A robot's weights on two partners around hand-overs.

It looks at all hand-overs together; one chosen episode, as in Fig. 5, is an illustration.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from innerattn.evaluate.clusters import ratio_intervals
from innerattn.evaluate.episodes import Record

Array = NDArray[np.float64]

_SHUFFLES = 9_999
_CHUNK = 2**21  # numbers gathered at once, 16 MB


@dataclass(frozen=True)
class Attended:
    """The weight on one partner; K = 1 + H columns: the mean over heads, then each head.

    Attributes:
        weight: (3, W, K) float64 mean, low and high end by offset.
        change: (3, K) float64 mean, low and high end of the mean weight in the steps after the
            first rescue minus that in the steps up to it.
        p: (K,) float64 two-sided, of the change; NaN for a robot with one teammate.
    """

    weight: Array
    change: Array
    p: Array


@dataclass(frozen=True)
class HandoverAttention:
    """Attention of the robots that hand over, aligned on the first rescue.

    Only steps of a hand-over's own two stages count: none before `start`, none after `second`. The
    95 % intervals are over episodes, since hand-overs of one episode share steps; NaN where
    less than two episodes have the offset.

    Attributes:
        handovers: N.
        episodes: episodes they come from.
        offsets: (W,) int64 steps since the first rescue's; the action of offset 0 completes it, so
            offsets above 0 are those after it.
        counts: (W,) int64 hand-overs with such a step.
        to_be: the partner of the second rescue.
        before: the partner of the first.
    """

    handovers: int
    episodes: int
    offsets: NDArray[np.int64]
    counts: NDArray[np.int64]
    to_be: Attended
    before: Attended


def handover_attention(
    record: Record, handovers: NDArray[np.void], seed: int, reach: int = 8
) -> HandoverAttention | None:
    """How attention moves from one partner to the next.

    The p-values are of a permutation test: if attention does not know who the partners are,
    teammates' names can be exchanged. One order of teammates (by index, the robot itself left out)
    is drawn for each episode, for all its hand-overs, which are not independent; p is the share of
    9,999 draws, and of what is seen, with a mean change at least as large either way. A
    change that always goes with one teammate, whatever the work, is not told apart unless
    hand-overs in both orders of the tasks are given.

    Attention may pass on because other victims need other robots, whoever goes. As a control give
    the same hand-overs with ``robot`` replaced by one that takes no part in them.

    Args:
        record: with attention.
        handovers: (N,) `handover.HANDOVER` of this record, of any robots.
        seed: seed of the permutations.
        reach: steps looked at on either side, W / 2.

    Returns:
        None where there is no hand-over or the record has no attention.

    Raises:
        ValueError: reach is not positive, or a robot is its own partner.
    """
    if reach < 1:
        raise ValueError(f"reach = {reach}: must be 1 or more")
    partners = np.stack([handovers["after"], handovers["before"]])
    if (partners == handovers["robot"]).any():
        raise ValueError("handovers: a robot cannot be before or after itself")
    if not len(handovers) or "attention" not in record.steps:
        return None
    offsets = np.arange(1 - reach, reach + 1)
    weights, counted = aligned_weights(record, handovers, offsets)
    names, episode = np.unique(handovers["episode"], return_inverse=True)
    changes = _mean(weights, counted & (offsets > 0)) - _mean(weights, counted & (offsets <= 0))
    roles = partners - (partners > handovers["robot"])
    to_be, before = (
        Attended(*_courses(weights, counted, changes, role, episode), p)
        for role, p in zip(roles, _permutation_p(changes, roles, episode, seed), strict=True)
    )
    return HandoverAttention(
        handovers=len(handovers),
        episodes=len(names),
        offsets=offsets,
        counts=counted.sum(0),
        to_be=to_be,
        before=before,
    )


def aligned_weights(
    record: Record, handovers: NDArray[np.void], offsets: NDArray[np.int64]
) -> tuple[Array, NDArray[np.bool_]]:
    """A robot's attention around its hand-overs.

    Args:
        record: with attention.
        handovers: (N,) `handover.HANDOVER`.
        offsets: (W,) steps since the first rescue's.

    Returns:
        (N, W, 1 + H, R - 1) float64 weights on teammates by index, the robot itself left out: their
        mean over heads, then each head; NaN outside the hand-over's stages. (N, W) bool whether it
        is inside.
    """
    step = handovers["first"][:, None] + offsets
    inside = (step >= handovers["start"][:, None]) & (step <= handovers["second"][:, None])
    attention = record.steps["attention"]
    robots = np.arange(attention.shape[-1])
    teammates = np.stack([np.delete(robots, robot) for robot in robots])
    robot = handovers["robot"]
    episode = handovers["episode"] - record.first_episode
    shown = np.where(inside, step, 0)
    heads = attention[episode[:, None], shown, :, robot[:, None]].astype(np.float64)
    heads = np.take_along_axis(heads, teammates[robot][:, None, None], -1)
    weights = np.concatenate([heads.mean(2, keepdims=True), heads], 2)
    return np.where(inside[..., None, None], weights, np.nan), inside


def _mean(weights: Array, chosen: NDArray[np.bool_]) -> Array:
    """Mean over the chosen of W steps, (N, K, R - 1); there is always one on either side."""
    total = np.where(chosen[..., None, None], weights, 0.0).sum(1)
    return np.asarray(total / chosen.sum(1)[:, None, None])


def _courses(
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
    """Sums over the hand-overs of each episode."""
    sums = np.zeros((episode.max() + 1, *values.shape[1:]))
    np.add.at(sums, episode, values)
    return sums


def _permutation_p(
    changes: Array, roles: NDArray[np.int64], episode: NDArray[np.int64], seed: int
) -> Array:
    """p-values (C, K) of the mean changes on the teammates in C roles.

    Args:
        changes: (N, K, M) by teammate.
        roles: (C, N) index of the teammate in each role.
        episode: (N,) from 0.
        seed: seed of the permutations.
    """
    (events, heads, teammates), episodes = changes.shape, int(episode.max()) + 1
    if teammates < 2:
        return np.full((len(roles), heads), np.nan)
    # What an episode adds to the sum if teammate s stands in for teammate r, (C, E, M, M, K).
    parts = np.zeros((len(roles), episodes, teammates, teammates, heads))
    for part, role in zip(parts, roles, strict=True):
        np.add.at(part, (episode, role), changes.transpose(0, 2, 1))
    seen = np.abs([changes[np.arange(events), :, role].sum(0) for role in roles])
    rng = np.random.default_rng(seed)
    larger = np.ones(seen.shape)
    rows, teammate = np.arange(episodes)[:, None], np.arange(teammates)
    step = max(1, _CHUNK // parts.size)
    for start in range(0, _SHUFFLES, step):
        count = min(step, _SHUFFLES - start)
        orders = rng.permuted(np.tile(teammate, (count, episodes, 1)), axis=-1)
        drawn = np.abs(parts[:, rows, teammate, orders].sum((2, 3)))
        larger += (drawn >= seen[:, None] - 1e-12).sum(1)
    return larger / (_SHUFFLES + 1)
