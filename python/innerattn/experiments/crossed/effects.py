"""Effects of attention, credit and regularisation on the runs' outcomes; the seed is the unit.

An effect is a contrast of arms: a weighted sum of their means. Uniform attention has nothing to
regularise, so that its one arm is compared with those of learnt attention at every weight.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from innerattn.experiments.crossed.arms import CREDITS, CROSSED, PENALTIES, SHARED, Arm, Credit
from innerattn.experiments.crossed.outcome import Outcomes, by_seed
from innerattn.experiments.paper import pairs
from innerattn.experiments.paper.claims import ENTROPY_MARGIN
from innerattn.stats.comparison import Contrast, contrast, holm

MARGINS = {
    "imbalance": pairs.MARGINS["imbalance"],
    "score": pairs.MARGINS["score"],
    "entropy_share": ENTROPY_MARGIN,
}
"""The outcomes that effects are estimated for, and the largest difference that counts as none."""

LEAST_SEEDS = 3
"""An effect needs so many seeds that have a run of each arm."""

ATTENTION = "inner − uniform, mean over credits and λ"
CREDIT = "team − helpers credit, mean over attentions and λ"
"""Names of the two effects that claims are about; λ is the weight of the regularisation."""

Weights = Mapping[Arm, float]


@dataclass(frozen=True)
class Effect:
    """One effect in one situation.

    Attributes:
        situation: of the worlds.
        outcome: one of `MARGINS`.
        name: what is compared with what.
        main: it is an average over weights of the regularisation, or more, or an interaction; else
            it is of single arms.
        seeds: how many have the outcome in each of the compared arms.
        contrast: None where these are fewer than `LEAST_SEEDS`, or do not differ.
        holm_p: its p-value, adjusted within its family: the main effects on all outcomes in a
            situation, or all other effects there.
    """

    situation: str
    outcome: str
    name: str
    main: bool
    seeds: int
    contrast: Contrast | None
    holm_p: float | None = None


def contrasts() -> list[tuple[str, bool, Weights]]:
    """All effects: name, whether it is a main effect, weights of arms."""
    least, most = PENALTIES[0], PENALTIES[-1]
    attention = {credit: _attention(credit) for credit in CREDITS}
    helpers, team = (attention[credit] for credit in ("helpers", "team"))
    named: list[tuple[str, bool, Weights]] = [
        (ATTENTION, True, _mean([helpers, team])),
        ("inner − uniform under team credit, mean over λ", True, team),
        (CREDIT, True, _credit(CROSSED)),
        (
            f"λ = {most:g} − λ = {least:g}, mean over credits",
            True,
            _mean([_penalty(credit, most) for credit in CREDITS]),
        ),
        ("(inner − uniform) under team − under helpers credit", True, _minus(team, helpers)),
    ]
    for credit in CREDITS:
        named += [
            (
                f"inner λ = {penalty:g} − uniform, {credit}",
                False,
                {Arm(credit, penalty): 1.0, Arm(credit, None): -1.0},
            )
            for penalty in PENALTIES
        ]
        named += [
            (f"λ = {penalty:g} − λ = {least:g}, {credit}", False, _penalty(credit, penalty))
            for penalty in PENALTIES[1:]
        ]
    for penalty in (None, *PENALTIES):
        arms = [Arm(credit, penalty) for credit in CREDITS]
        words = "uniform" if penalty is None else f"inner λ = {penalty:g}"
        named.append((f"team − helpers credit, {words}", False, _credit(arms)))
    own = Arm(SHARED.credit, SHARED.penalty)
    name = f"shared parameters − own parameters, {own.credit}, inner λ = {least:g}"
    return [*named, (name, False, {SHARED: 1.0, own: -1.0})]


def effects(situation: str, outcomes: Outcomes) -> list[Effect]:
    """All effects on all outcomes in one situation.

    Args:
        situation: of the worlds.
        outcomes: of the runs of each arm; arms without runs may be missing.
    """
    every = []
    for outcome, margin in MARGINS.items():
        for name, main, weights in contrasts():
            rows = by_seed(outcomes, list(weights), outcome)
            enough = len(rows) >= LEAST_SEEDS
            compared = contrast(rows, list(weights.values()), margin) if enough else None
            every.append(Effect(situation, outcome, name, main, len(rows), compared))
    return _adjusted(every, main=True) + _adjusted(every, main=False)


def _adjusted(every: Sequence[Effect], main: bool) -> list[Effect]:
    """The effects of one family, with their p-values adjusted for each other."""
    family = [one for one in every if one.main == main]
    adjusted = iter(holm([one.contrast.p for one in family if one.contrast is not None]))
    return [replace(one, holm_p=next(adjusted)) if one.contrast else one for one in family]


def _attention(credit: Credit) -> Weights:
    """Learnt attention, averaged over weights of the regularisation, minus uniform attention."""
    inner = {Arm(credit, penalty): 1.0 / len(PENALTIES) for penalty in PENALTIES}
    return {**inner, Arm(credit, None): -1.0}


def _penalty(credit: Credit, penalty: float) -> Weights:
    """A weight of the regularisation minus the least one."""
    return {Arm(credit, penalty): 1.0, Arm(credit, PENALTIES[0]): -1.0}


def _credit(arms: Sequence[Arm]) -> Weights:
    """Team minus helpers credit, averaged over attentions, then over weights."""
    weights = {}
    attentions = {arm.method for arm in arms}
    for arm in arms:
        alike = sum(a.method == arm.method and a.credit == arm.credit for a in arms)
        sign = 1.0 if arm.credit == "team" else -1.0
        weights[arm] = sign / (alike * len(attentions))
    return weights


def _mean(parts: Sequence[Weights]) -> Weights:
    """The average of contrasts of different arms."""
    return {arm: weight / len(parts) for part in parts for arm, weight in part.items()}


def _minus(one: Weights, other: Weights) -> Weights:
    """The difference of contrasts of different arms."""
    return {**one, **{arm: -weight for arm, weight in other.items()}}
