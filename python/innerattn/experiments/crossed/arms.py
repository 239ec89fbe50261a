"""The arms of the crossed design; ``crossed.toml`` of the shipped studies lists their runs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from innerattn.experiments.plan import Case

Credit = Literal["helpers", "team"]

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


CROSSED = tuple(Arm(credit, penalty) for credit in CREDITS for penalty in (None, *PENALTIES))
"""Both attentions, with learnt attention at every penalty, under both credits."""
SHARED = Arm("team", PENALTIES[0], shared=True)
"""A further arm: can robots that have the same parameters be unlike in what they do?"""
ARMS = (*CROSSED, SHARED)
"""All arms."""

SWAPPED = "-swapped"
"""Ends the variant of a run with swapped weights."""


def arm_of(case: Case) -> Arm:
    """The arm that a planned run belongs to.

    Raises:
        KeyError: it belongs to none.
    """
    return {(arm.method, arm.variant): arm for arm in ARMS}[case.method, case.variant]
