"""From measurements to the results that are reported; it disturbs nothing."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any, Literal

import numpy as np
import torch
from torch import Tensor

from innerattn.evaluate.bounds.disturb import ASCENT_STEPS, Changed, Direction, Measurements
from innerattn.evaluate.bounds.inequalities import TOLERANCE, violated

SCHEMA_VERSION = 2

Attention = Literal["inner", "uniform", "none"]


@dataclass(frozen=True)
class Check:
    """How one inequality, measured <= bound, fared.

    Attributes:
        checks: how many times it was checked.
        violations: how many times it failed by more than the tolerance.
        median_change: of what was measured.
        largest_change: of what was measured.
        median_tightness: of measured / bound; where the bound is within the tolerance of 0, 0.
        largest_tightness: of the same.
    """

    checks: int
    violations: int
    median_change: float
    largest_change: float
    median_tightness: float
    largest_tightness: float


@dataclass(frozen=True)
class ValueChange:
    """How a robot's values moved.

    Attributes:
        median: of |Q' - Q|, the largest over the robot's own actions.
        largest: of the same.
        flips: share in which the best own action became another; None where the critic does not
            value own actions.
    """

    median: float
    largest: float
    flips: float | None


@dataclass(frozen=True)
class Level:
    """What changes of one kind and size did.

    Attributes:
        changed: e_j, or the critic's copy of o_j (and, for ``actor_flips``, the actor's, too).
        direction: drawn at random, or by gradient ascent on |S'_ij - S_ij| ("gradient") or on
            |S'_jk - S_jk| ("gradient_own"), j being the changed robot.
        radius: the share of the root mean square norm.
        checks: by inequality; those of what the changes aim at, empty where nothing is scored.
        largest_weight_change: of |alpha'_ij - alpha_ij|; None where there is no attention, or where
            the changes aim at the robot's own row.
        teammates: of Q_i, i != j; None where the changes aim at the robot's own row.
        own: of Q_j; None where e_j is changed, on which Q_j does not depend.
        actor_flips: share in which actor j's likeliest action became another, for the same change
            of o_j; None where e_j is changed.
    """

    changed: Changed
    direction: Direction
    radius: float
    checks: dict[str, Check]
    largest_weight_change: float | None
    teammates: ValueChange | None
    own: ValueChange | None
    actor_flips: float | None


@dataclass(frozen=True)
class Bounds:
    """The bounds of one run, and what was measured against them.

    Attributes:
        attention: "inner", "uniform" or "none"; logits are scored by inner attention only.
        seed: of states and draws.
        states: how many.
        draws: random directions for each robot and state.
        query_norms: ||w_q|| by head; empty where nothing is scored.
        key_norms: ||w_k|| by head; likewise.
        embedding_norms: root mean square of ||e_j|| by robot; empty where there is no attention.
        observation_norms: root mean square of ||o_j|| by robot.
        value_standard_deviation: of Q_i over states and own actions, the root mean square over
            robots; the scale of changes of Q.
        levels: by what is changed, radius and direction.
    """

    attention: Attention
    seed: int
    states: int
    draws: int
    query_norms: tuple[float, ...]
    key_norms: tuple[float, ...]
    embedding_norms: tuple[float, ...]
    observation_norms: tuple[float, ...]
    value_standard_deviation: float
    levels: tuple[Level, ...]

    @property
    def violations(self) -> int:
        """Violations of all inequalities at all levels; 0 unless something is wrong."""
        return sum(check.violations for level in self.levels for check in level.checks.values())

    def to_json(self) -> dict[str, Any]:
        """A document of plain values."""
        return {
            "schema_version": SCHEMA_VERSION,
            "violations": self.violations,
            "tolerance": TOLERANCE,
            "ascent_steps": ASCENT_STEPS,
            **asdict(self),
        }


def level_of(
    changed: Changed, direction: Direction, radius: float, measured: Measurements
) -> Level:
    """The results of one level."""
    moved = {name: values.numpy() for name, values in measured.moved.items()}

    def values(prefix: str) -> ValueChange | None:
        if f"{prefix}values" not in moved:
            return None
        change, flips = moved[f"{prefix}values"], moved.get(f"{prefix}flips")
        share = None if flips is None else float(flips.mean())
        return ValueChange(float(np.median(change)), float(change.max()), share)

    weights, of_actor = moved.get("weights"), moved.get("actor_flips")
    return Level(
        changed=changed,
        direction=direction,
        radius=radius,
        checks={name: _check(*sides) for name, sides in measured.sides.items()},
        largest_weight_change=None if weights is None else float(np.abs(weights).max()),
        teammates=values(""),
        own=values("own_"),
        actor_flips=None if of_actor is None else float(of_actor.mean()),
    )


def _check(measured: Tensor, bound: Tensor) -> Check:
    share = torch.where(bound > TOLERANCE, measured / bound, 0.0)
    return Check(
        checks=len(measured),
        violations=int(violated(measured, bound).sum()),
        median_change=float(np.median(measured.numpy())),
        largest_change=float(measured.max()),
        median_tightness=float(np.median(share.numpy())),
        largest_tightness=float(share.max()),
    )
