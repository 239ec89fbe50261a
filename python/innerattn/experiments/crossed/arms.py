"""The arms of the crossed design, and the runs that they need; it looks at no folder."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from innerattn.experiments.plan import Case, PlannedRun, planned_run

Credit = Literal["helpers", "team"]

SITUATIONS = ("single", "mixed")
"""The built-in scenarios that arms are compared in, unless told otherwise."""
CREDITS: tuple[Credit, ...] = ("helpers", "team")
"""Who is paid for a rescue: `scenario.rescue_credit`."""
PENALTIES = (0.0, 1e-4, 1e-3)
"""Values of `td.attention_logit_penalty`."""


@dataclass(frozen=True)
class Arm:
    """One way to train.

    Attributes:
        credit: who is paid for a rescue.
        penalty: of attention logits; None with uniform weights, which have no logits, so that one
            arm stands for all penalties.
        shared: robots of a kind have the same parameters.
    """

    credit: Credit
    penalty: float | None
    shared: bool = False

    @property
    def method(self) -> str:
        """The value of `train.method`."""
        return "td-uniform" if self.penalty is None else "td-inner"

    @property
    def variant(self) -> str:
        """What is not said by the method, as a word."""
        word = self.credit if self.penalty is None else f"{self.credit}-penalty-{self.penalty:g}"
        return f"{word}-shared" if self.shared else word

    def __str__(self) -> str:
        """How tables name it: attention, λ where there is one, credit."""
        attention = "uniform" if self.penalty is None else f"inner λ = {self.penalty:g}"
        return f"{attention}, {self.credit}{', shared by kind' if self.shared else ''}"

    def overrides(self) -> dict[str, object]:
        """Values by dotted key that make the arm what it is."""
        penalty = 0.0 if self.penalty is None else self.penalty
        return {
            "scenario.rescue_credit": self.credit,
            "td.attention_logit_penalty": penalty,
            "network.parameter_sharing": "kind" if self.shared else "none",
        }


CROSSED = tuple(Arm(credit, penalty) for credit in CREDITS for penalty in (None, *PENALTIES))
"""Both attentions, with learnt attention at every penalty, under both credits."""
SHARED = Arm("team", PENALTIES[0], shared=True)
"""A further arm: can robots that have the same parameters be unlike in what they do?"""
ARMS = (*CROSSED, SHARED)
"""All arms."""

WITH_SWAPS = {arm.method: arm for arm in (Arm("team", None), Arm("team", 0.0))}
"""Arms whose runs have others beside them in which robots swap their initial weights, by method."""
SWAPPED = "-swapped"
"""Ends the variant of a run with swapped weights."""
_SWAP = {"network.swapped_robots": ["food_0", "food_1"]}


def plan_crossed(
    methods: Sequence[str],
    situations: Sequence[str],
    seeds: Sequence[int],
    budget: str,
    out: Path,
    overrides: Mapping[str, object] | None = None,
) -> list[PlannedRun]:
    """The runs of the `ARMS` of some methods, as `innerattn.experiments.plan.plan` lists runs."""
    return [
        planned_run(
            Case(situation, arm.method, seed, arm.variant),
            budget,
            out,
            {**(overrides or {}), **arm.overrides()},
        )
        for seed in seeds
        for situation in situations
        for arm in ARMS
        if arm.method in methods
    ]


def plan_swapped(
    methods: Sequence[str],
    situations: Sequence[str],
    seeds: Sequence[int],
    budget: str,
    out: Path,
    overrides: Mapping[str, object] | None = None,
) -> list[PlannedRun]:
    """Pairs of runs, as `innerattn.experiments.plan.plan` lists runs.

    Those with weights as they were drawn are runs of the crossed design; a study has them once.
    """
    return [
        planned_run(
            Case(situation, arm.method, seed, arm.variant + word),
            budget,
            out,
            {**(overrides or {}), **arm.overrides(), **changes},
        )
        for seed in seeds
        for situation in situations
        for arm in (WITH_SWAPS[method] for method in methods)
        for word, changes in (("", {}), (SWAPPED, _SWAP))
    ]


def arm_of(case: Case) -> Arm:
    """The arm that a planned run belongs to.

    Raises:
        KeyError: it belongs to none.
    """
    return {(arm.method, arm.variant): arm for arm in ARMS}[case.method, case.variant]
