"""Disturbs one robot of a team, each in turn, and gathers what moved and how far it might have.

Random changes are drawn by the caller; changes that aim at a logit begin at the drawn ones.
"""

from __future__ import annotations

from typing import Literal, NamedTuple, cast

import torch
from torch import Tensor

from innerattn.evaluate.bounds.inequalities import (
    Sides,
    logit_slopes,
    own_row_sides,
    teammates_sides,
)
from innerattn.evaluate.bounds.perturbation import strongest_change
from innerattn.evaluate.bounds.response import (
    Response,
    States,
    actor_flips,
    respond_to_embedding,
    respond_to_observation,
)
from innerattn.nn import Actor, CentralCritic, Critic, InnerAttention, JointCritic

Changed = Literal["embedding", "observation"]
"""What is changed: e_j, or the critic's copy of o_j, through which e_j and e_j^s change."""

Direction = Literal["random", "gradient", "gradient_own"]
"""As drawn; or by gradient ascent on |S'_ij - S_ij| for each i and head, or on |S'_jk - S_jk| for
each k and head. Only inner attention has logits S."""

ASCENT_STEPS = 8
"""Steps of gradient ascent, each as long as the radius."""

_ROWS_AT_ONCE = 4096


class Measurements(NamedTuple):
    """How far the changes moved what, one row each; only entries that a change aims at count.

    Random changes of e_j aim at rows i != j of the logits; those of o_j aim at row j, too.

    Attributes:
        sides: (2, n) by inequality: what was measured, and its bound.
        moved: (n,) by name: "weights" alpha'_ij - alpha_ij; "values" |Q'_i - Q_i|, the largest
            over own actions, and "flips" of the best own action, of teammates i; "own_values" and
            "own_flips" the same of robot j itself; "actor_flips" of its actor's likeliest action.
            What does not exist is absent.
    """

    sides: dict[str, Tensor]
    moved: dict[str, Tensor]


def disturb(
    critic: Critic | JointCritic | CentralCritic,
    actor: Actor,
    states: States,
    changed: Changed,
    direction: Direction,
    drawn: Tensor,
) -> Measurements:
    """Change the input of each robot in turn.

    Args:
        critic: float64 and without gradients; with any attention if embeddings are changed, with
            inner attention unless the direction is "random".
        actor: float64 and without gradients.
        states: B states.
        changed: what is changed.
        direction: how the changes are chosen.
        drawn: (R, K, B, X) random changes of robot j, of one length for each j.
    """
    robots, draws, batch, _ = drawn.shape
    variants = draws
    if direction != "random" and isinstance(critic, Critic):
        variants = robots * critic.attention.heads
    at_once = max(1, _ROWS_AT_ONCE // (robots * variants))
    parts = []
    for start in range(0, batch, at_once):
        rows = slice(start, start + at_once)
        part = states.some(rows)
        parts.append(_disturb(critic, actor, part, changed, direction, drawn[:, :, rows]))
    return Measurements(
        {name: torch.cat([part.sides[name] for part in parts], 1) for name in parts[0].sides},
        {name: torch.cat([part.moved[name] for part in parts]) for name in parts[0].moved},
    )


def _disturb(
    critic: Critic | JointCritic | CentralCritic,
    actor: Actor,
    states: States,
    changed: Changed,
    direction: Direction,
    drawn: Tensor,
) -> Measurements:
    logits = None
    if isinstance(critic, Critic) and isinstance(critic.attention, InnerAttention):
        logits = _Logits(critic, states)
    change = drawn if logits is None else logits.strongest(changed, direction, drawn)
    if isinstance(critic, Critic) and changed == "embedding":
        response = respond_to_embedding(critic, states, change)
    else:
        response = respond_to_observation(critic, states, change)
    heads = 1 if response.weights is None else response.weights.shape[3]
    aimed = _aimed(len(drawn), heads, direction)
    teammates, itself = aimed.any(3), aimed.any(4).any(3)
    moved: dict[str, Tensor] = {}

    def keep(name: str, values: Tensor | None, mask: Tensor) -> None:
        if values is not None:
            moved[name] = _picked(values, mask)

    if direction != "gradient_own":
        keep("weights", response.weights, aimed)
        keep("values", response.values, teammates)
        keep("flips", response.flips, teammates)
    if changed == "observation":
        keep("own_values", response.own_values, itself)
        keep("own_flips", response.own_flips, itself)
        keep("actor_flips", actor_flips(actor, states.obs, change), itself)
    sides = {} if logits is None else logits.sides(changed, direction, change, response)
    return Measurements({name: _picked_sides(both, aimed) for name, both in sides.items()}, moved)


class _Logits:
    """The logits of inner attention in given states."""

    def __init__(self, critic: Critic, states: States) -> None:
        attention = cast(InnerAttention, critic.attention)
        query, key, heads = attention.query, attention.key, attention.heads
        self._critic, self._states = critic, states
        self._own, self._others = critic.encode(states.obs, states.actions)
        self._to_teammates = logit_slopes(self._own, query, key, heads)
        self._of_own_row = logit_slopes(self._others, key, query, heads)

    def strongest(self, changed: Changed, direction: Direction, drawn: Tensor) -> Tensor:
        """Changes that move logits far; as drawn where the direction is random."""
        if direction == "random":
            return drawn
        slopes = self._of_own_row if direction == "gradient_own" else self._to_teammates
        if changed == "embedding":
            return strongest_change(
                lambda e: e, self._others, slopes.directions, drawn, ASCENT_STEPS
            )
        which = 0 if direction == "gradient_own" else 1
        return strongest_change(
            lambda obs: self._encode(obs)[which],
            self._states.obs,
            slopes.directions,
            drawn,
            ASCENT_STEPS,
        )

    def sides(
        self, changed: Changed, direction: Direction, change: Tensor, response: Response
    ) -> dict[str, Sides]:
        """Both sides of all inequalities about what the changes aim at."""
        if changed == "embedding":
            return teammates_sides(response, self._to_teammates, change.norm(dim=3))
        own, others = self._encode((self._states.obs.unsqueeze(1) + change).flatten(1, 2))
        sides: dict[str, Sides] = {}
        if direction != "gradient_own":
            reach = _distance(others, self._others)
            sides |= teammates_sides(response, self._to_teammates, reach)
        if direction != "gradient":
            reach = _distance(own, self._own)
            sides |= own_row_sides(response, self._of_own_row, reach)
        return sides

    def _encode(self, obs: Tensor) -> tuple[Tensor, Tensor]:
        """Encodings of observations (R, M*B, D), with the actions of the states."""
        actions = self._states.actions
        return self._critic.encode(obs, actions.repeat(1, obs.shape[1] // actions.shape[1]))


def _distance(moved: Tensor, encodings: Tensor) -> Tensor:
    """(R, M, B) how far encodings (R, M*B, W) lie from those (R, B, W) before."""
    robots, batch, width = encodings.shape
    moved = moved.view(robots, -1, batch, width)
    distance: Tensor = (moved - encodings.unsqueeze(1)).norm(dim=3)
    return distance


def _aimed(robots: int, heads: int, direction: Direction) -> Tensor:
    """Which logits the changes of robot j aim at: (R, M or 1, 1, H, R) bool, by head and teammate.

    Random ones aim at all; change o * H + h of the others at head h and robot o; none at j itself.
    """
    others = ~torch.eye(robots, dtype=torch.bool).view(robots, 1, 1, 1, robots)
    if direction == "random":
        return others.expand(-1, -1, -1, heads, -1)
    one_each = torch.eye(robots * heads, dtype=torch.bool).view(-1, robots, heads)
    return others & one_each.transpose(1, 2).unsqueeze(1)


def _picked(values: Tensor, mask: Tensor) -> Tensor:
    """(n,) the values where the mask, of a shape that broadcasts to theirs, is set."""
    return values[mask.expand(values.shape)]


def _picked_sides(both: Sides, aimed: Tensor) -> Tensor:
    """(2, n) both sides where they are aimed at; whole rows where any of their logits is."""
    of_rows = both[0].shape[4] == 1
    mask = aimed.any(4, keepdim=True) if of_rows else aimed
    return torch.stack([_picked(side, mask) for side in both])
