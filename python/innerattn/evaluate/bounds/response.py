"""What a critic does when one robot's input is changed: how its logits, weights and values move.

It knows no bound. Changes are (R, M, B, X): M changes of robot j (first) in each of B states.
"""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from innerattn.nn import Actor, CentralCritic, Critic, CriticOutput, JointCritic


class States(NamedTuple):
    """B states of a team, robots first.

    Attributes:
        obs: (R, B, D) float64.
        actions: (R, B) int64.
        available: (B, R) bool, who can be attended to; None: all. It stays as it is when an
            observation is changed.
    """

    obs: Tensor
    actions: Tensor
    available: Tensor | None = None

    def some(self, rows: slice) -> States:
        """The states in a slice."""
        available = None if self.available is None else self.available[rows]
        return States(self.obs[:, rows], self.actions[:, rows], available)


class Response(NamedTuple):
    """What has moved; where robot i or k is the changed robot j itself, an entry means nothing.

    Attributes:
        logits: (R, M, B, H, R) S'_ij - S_ij for changed robot j (first) and other robot i (last);
            None where nothing is scored.
        own_logits: (R, M, B, H, R) S'_jk - S_jk for changed robot j and other robot k; or None.
        weights: (R, M, B, H, R) alpha'_ij - alpha_ij; None where there is no attention.
        own_weights: (R, M, B, H, R) alpha'_jk - alpha_jk; or None.
        values: (R, M, B, R) largest |Q'_i - Q_i| over the own actions of robot i (last).
        own_values: (R, M, B) the same of robot j.
        flips: (R, M, B, R) bool, whether the best own action of robot i is another one; None where
            the critic does not value own actions.
        own_flips: (R, M, B) bool, the same of robot j; or None.
    """

    logits: Tensor | None
    own_logits: Tensor | None
    weights: Tensor | None
    own_weights: Tensor | None
    values: Tensor
    own_values: Tensor
    flips: Tensor | None
    own_flips: Tensor | None


@torch.no_grad()
def respond_to_observation(
    critic: Critic | JointCritic | CentralCritic, states: States, change: Tensor
) -> Response:
    """What moves when the critic's copy of o_j is changed.

    Args:
        critic: float64, as everything here.
        states: B states of the same worlds, with the actions taken in them.
        change: (R, M, B, D) added to the observation of robot j.
    """
    actions, available = _repeated(states, change)
    before = critic(*states)
    return _response(critic, before, critic(_moved(states.obs, change), actions, available), change)


@torch.no_grad()
def respond_to_embedding(critic: Critic, states: States, change: Tensor) -> Response:
    """What moves when e_j is changed.

    Args:
        critic: float64, as everything here.
        states: B states of the same worlds, with the actions taken in them.
        change: (R, M, B, W) added to the state-action encoding of robot j.
    """
    _, available = _repeated(states, change)
    own, others = critic.encode(states.obs, states.actions)
    before = critic.value(own, others, states.available)
    same = torch.zeros((), dtype=own.dtype).expand_as(change)
    after = critic.value(_moved(own, same), _moved(others, change), available)
    return _response(critic, before, after, change)


@torch.no_grad()
def actor_flips(actor: Actor, obs: Tensor, change: Tensor) -> Tensor:
    """(R, M, B) bool: whether actor j's likeliest action is another one, for o_j + change.

    Args:
        actor: float64.
        obs: (R, B, D).
        change: (R, M, B, D).
    """
    before: Tensor = actor(obs).argmax(1)
    after: Tensor = actor((obs.unsqueeze(1) + change).flatten(1, 2)).argmax(1)
    return after.view(change.shape[:3]) != before.unsqueeze(1)


def _moved(base: Tensor, change: Tensor) -> Tensor:
    """(R, R*M*B, X): (R, B, X) once for each robot j and variant, with j's own entry changed."""
    robots, variants, batch, width = change.shape
    rows = base.view(robots, 1, 1, batch, width).expand(-1, robots, variants, -1, -1).clone()
    rows.diagonal(dim1=0, dim2=1).add_(change.movedim(0, -1))
    return rows.flatten(1, 3)


def _repeated(states: States, change: Tensor) -> tuple[Tensor, Tensor | None]:
    """Actions and availability for the rows of `_moved`."""
    times = change.shape[0] * change.shape[1]
    available = states.available
    return (
        states.actions.repeat(1, times),
        None if available is None else available.repeat(times, 1),
    )


def _response(
    critic: Critic | JointCritic | CentralCritic,
    before: CriticOutput,
    after: CriticOutput,
    change: Tensor,
) -> Response:
    rows = change.shape[:3]
    q = before.q[:, :, None, None]
    moved_q = after.q.view(*before.q.shape[:2], *rows)  # (R, A, R, M, B)
    values = (moved_q - q).abs().amax(1)
    flips = moved_q.argmax(1) != q.argmax(1) if q.shape[1] > 1 else None
    logits = weights = None
    if isinstance(critic, Critic) and before.attended and after.attended:
        old, new = before.attended, after.attended
        matrices = (*rows, *old.weights.shape[1:])  # (R, M, B, H, R, R)
        weights = new.weights.reshape(matrices) - old.weights
        if old.scores is not None and new.scores is not None:
            head_width = critic.attention.width // critic.attention.heads
            logits = (new.scores.reshape(matrices) - old.scores) * head_width**-0.5
    return Response(
        logits=None if logits is None else _of_changed(logits, 5),
        own_logits=None if logits is None else _of_changed(logits, 4),
        weights=None if weights is None else _of_changed(weights, 5),
        own_weights=None if weights is None else _of_changed(weights, 4),
        values=values.movedim(0, -1),
        own_values=values.diagonal(dim1=0, dim2=1).movedim(-1, 0),
        flips=None if flips is None else flips.movedim(0, -1),
        own_flips=None if flips is None else flips.diagonal(dim1=0, dim2=1).movedim(-1, 0),
    )


def _of_changed(moved: Tensor, dim: int) -> Tensor:
    """Of (R, M, B, H, R, R) the entries of the changed robot in a dimension, (R, M, B, H, R)."""
    return moved.diagonal(dim1=0, dim2=dim).movedim(-1, 0)
