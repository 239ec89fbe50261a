"""Effects of attention, credit and regularisation on the runs' outcomes; the seed is the unit.

An effect is a contrast of arms: a weighted sum of their means. Uniform attention has nothing to
regularise, so that its one arm is compared with those of learnt attention at every weight.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from innerattn.experiments.crossed.arms import CREDITS, PENALTIES, SHARED, Arm, Credit
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
"""An effect, or a correlation, needs so many seeds that have a run of each arm."""

ATTENTION = "inner − uniform, mean over credits and λ"
CREDIT = "team − helpers credit, mean over attentions and λ"
"""Names of the two effects that claims are about; λ is the weight of the regularisation."""

Weights = Mapping[Arm, float]

_EITHER: dict[Credit, float] = {"helpers": 0.5, "team": 0.5}
_TEAM_OR_HELPERS: dict[Credit, float] = {"helpers": -1.0, "team": 1.0}


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
    attention: dict[float | None, float] = {one: 1.0 / len(PENALTIES) for one in PENALTIES}
    attention[None] = -1.0
    both: dict[float | None, float] = {None: 0.5}
    both |= {one: 0.5 / len(PENALTIES) for one in PENALTIES}
    named: list[tuple[str, bool, Weights]] = [
        (ATTENTION, True, weights(_EITHER, attention)),
        ("inner − uniform under team credit, mean over λ", True, weights({"team": 1.0}, attention)),
        (CREDIT, True, weights(_TEAM_OR_HELPERS, both)),
        (
            f"λ = {most:g} − λ = {least:g}, mean over credits",
            True,
            weights(_EITHER, {most: 1.0, least: -1.0}),
        ),
        (
            "(inner − uniform) under team − under helpers credit",
            True,
            weights(dict(reversed(_TEAM_OR_HELPERS.items())), attention),
        ),
    ]
    pairs: list[tuple[str, float, float | None]] = [
        *((f"inner λ = {penalty:g} − uniform", penalty, None) for penalty in PENALTIES),
        *((f"λ = {penalty:g} − λ = {least:g}", penalty, least) for penalty in PENALTIES[1:]),
    ]
    named += [
        (f"{name}, {credit}", False, weights({credit: 1.0}, {one: 1.0, other: -1.0}))
        for credit in CREDITS
        for name, one, other in pairs
    ]
    for penalty in (None, *PENALTIES):
        words = "uniform" if penalty is None else f"inner λ = {penalty:g}"
        name = f"team − helpers credit, {words}"
        named.append((name, False, weights(_TEAM_OR_HELPERS, {penalty: 1.0})))
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
    for outcome in MARGINS:
        for name, main, of_arms in contrasts():
            seeds, compared = compared_arms(outcomes, of_arms, outcome)
            every.append(Effect(situation, outcome, name, main, seeds, compared))
    return _adjusted(every, main=True) + _adjusted(every, main=False)


def weights(credits: Mapping[Credit, float], attentions: Mapping[float | None, float]) -> Weights:
    """Weights of crossed arms: the products of those of credits and of λ; None is uniform."""
    return {
        Arm(credit, penalty): of_credit * of_attention
        for credit, of_credit in credits.items()
        for penalty, of_attention in attentions.items()
    }


def compared_arms(
    outcomes: Outcomes, of_arms: Weights, outcome: str
) -> tuple[int, Contrast | None]:
    """How many seeds have an outcome in all arms, and the contrast of the arms over these."""
    rows = by_seed(outcomes, list(of_arms), outcome)
    enough = len(rows) >= LEAST_SEEDS
    found = contrast(rows, list(of_arms.values()), MARGINS[outcome]) if enough else None
    return len(rows), found


def _adjusted(every: Sequence[Effect], main: bool) -> list[Effect]:
    """The effects of one family, with their p-values adjusted for each other."""
    family = [one for one in every if one.main == main]
    adjusted = iter(holm([one.contrast.p for one in family if one.contrast is not None]))
    return [replace(one, holm_p=next(adjusted)) if one.contrast else one for one in family]
