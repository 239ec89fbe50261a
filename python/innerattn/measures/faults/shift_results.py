"""The results about attention when a robot fails, as data; it computes nothing."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from innerattn.stats import Estimate
from innerattn.stats.estimate import as_json

SCHEMA_VERSION = 1

CURVE_STEPS = 8
"""Steps before the onset, and from it on, that a curve shows where the window has as many."""


@dataclass(frozen=True)
class ByHead:
    """An estimate for the weights averaged over heads, and for each head's own."""

    mean: Estimate
    heads: tuple[Estimate, ...]


@dataclass(frozen=True)
class Shift:
    """The effect of one robot's fault on the weight on it, alpha_ij averaged over its teammates i.

    Intervals are bootstraps over episodes.

    Attributes:
        robot: its name.
        value: of the fault.
        before: mean weight over the steps before the onset.
        after: over as many steps from the onset on.
        change: ``after`` minus ``before``; other things than the fault change with time, too.
        effect: mean weight after the onset minus that at the same steps of the same worlds without
            the fault; the effect of the fault.
        curve: mean weight by step, as many before the onset as from it on; None where no episode
            goes on.
        effect_curve: likewise, minus that without the fault; 0 before the onset.
        shuffled: ``effect`` on robots that are labelled failing at random, and its middle 95 %.
        p_value: two-sided, of the permutation test that shuffles these labels.
        auc: how well the weight tells that the robot is faulty; see `KindShift`.
    """

    robot: str
    value: float
    before: ByHead
    after: ByHead
    change: ByHead
    effect: ByHead
    curve: tuple[Estimate | None, ...]
    effect_curve: tuple[Estimate | None, ...]
    shuffled: Estimate
    p_value: float
    auc: Estimate


@dataclass(frozen=True)
class KindShift:
    """The effect of one kind of fault on the weight on the robot that has it.

    Attributes:
        kind: of the fault.
        effect: as in `Shift`, averaged over robots.
        auc: share of pairs in which the weight on a robot that is faulty is above the weight on a
            robot at such a step without the fault; all robots together. Above 0.5 faults draw
            attention, below 0.5 they turn it away, at 0.5 it tells nothing.
        robots: by robot.
    """

    kind: str
    effect: ByHead
    auc: ByHead
    robots: tuple[Shift, ...]


@dataclass(frozen=True)
class FaultAttention:
    """Where attention goes when a robot fails, for one run.

    Attributes:
        attention: "inner" or "uniform"; uniform weights do not move, so all effects are 0 (unless
            unavailable robots are masked).
        seed: of the worlds, the bootstrap and the shuffled labels.
        episodes: worlds played.
        counted: those that go on until the onset; all results are over them.
        episode_steps: their length T [control steps].
        onset_step: at which the faults begin.
        shuffles: how often labels were shuffled.
        even_share: 1 / (R - 1), the weight of every teammate where attention is even.
        effect: over all kinds and robots; see `KindShift`.
        auc: likewise, over the pairs of all kinds.
        kinds: by kind of fault.
    """

    attention: str
    seed: int
    episodes: int
    counted: int
    episode_steps: int
    onset_step: int
    shuffles: int
    even_share: float
    effect: ByHead
    auc: ByHead
    kinds: tuple[KindShift, ...]

    def to_json(self) -> dict[str, Any]:
        """A document of plain values."""
        return {"schema_version": SCHEMA_VERSION, **as_json(self)}
