"""What was expected of the crossed design beside what its runs show, decided by fixed rules."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from scipy.stats import binomtest

from innerattn.experiments.crossed.arms import CREDITS, CROSSED, PENALTIES, SHARED, Arm, Credit
from innerattn.experiments.crossed.effects import (
    ATTENTION,
    CREDIT,
    LEAST_SEEDS,
    MARGINS,
    Effect,
    compared_arms,
    weights,
)
from innerattn.experiments.crossed.outcome import IDLE, Outcomes, by_seed
from innerattn.experiments.paper.claims import EVEN_ENTROPY, Holds
from innerattn.stats import Estimate
from innerattn.stats.comparison import Contrast
from innerattn.stats.seeds import seed_estimate
from innerattn.stats.text import NONE, format_estimate

LEAST_WITHOUT_IDLE = 10
"""So many seeds without an idle robot say that there is none; fewer say nothing."""

LEAST_UNEVEN = MARGINS["imbalance"] / 2.0
"""Less imbalance than this is too little to ask what takes it away."""

_FREE, _HELD = PENALTIES[0], PENALTIES[-1]  # λ that leaves attention free, and that holds it even

RULES = f"""\
- **Unit.** The seed is the unit. Runs of one seed begin with the same weights, train in the same
  worlds and are measured in the same worlds, so they may be alike in all arms. Where arms are
  averaged or compared, each seed with a run of every such arm gives one number.
- **Intervals** are 95 %: Student's t over seeds, and Wilson's for counts of seeds. An effect, and a
  mean that decides, needs {LEAST_SEEDS} seeds.
- **Alike** means that two one-sided tests at 5 % put the difference within the equivalence margin:
  {MARGINS["imbalance"]:g} of imbalance, {MARGINS["score"]:g} of the score,
  {MARGINS["entropy_share"]:g} of the entropy's share of ln(N − 1).
- **Many tests.** Verdicts go by the intervals of single effects. The tables add Holm's p, adjusted
  within a situation for all main effects, or for all others.

The claims:

- **Attention makes sharing even under team credit.** Inner minus half of uniform decides. Yes if
  its interval is below 0: attention removes more than half of the imbalance. No if it is above 0.
  The question is asked only if there is imbalance to remove: the interval of uniform is above
  {LEAST_UNEVEN:g}.
- **Attention rescues more.** The score of inner minus uniform decides, a mean over both credits.
  Yes if its interval is above 0. No if it is below 0, or if the two are alike.
- Both are asked twice: for λ = {_FREE:g}, which leaves attention free, and for the mean over all λ.
- **Team credit makes sharing uneven.** The imbalance of team minus helpers decides, a mean over
  attentions and λ. Yes if its interval is above 0. No if it is below 0, or if the two are alike.
- **Team credit leaves a food robot idle with either attention.** A robot is idle if it takes part
  in less than {IDLE:g} of the rescues. Yes if both attentions have seeds with such a run. No if one
  attention has none in {LEAST_WITHOUT_IDLE} or more seeds. A seed has one run with uniform
  attention and {len(PENALTIES)} with inner attention, so the two counts cannot be compared.
- **Helpers credit makes sharing even with either attention.** Yes if no robot is idle in
  {LEAST_WITHOUT_IDLE} or more seeds and both intervals of the imbalance are below
  {MARGINS["imbalance"]:g}. No if a robot is idle, or if an interval is above that.
- **Shared parameters make sharing even under team credit.** Decided like the claim before, for the
  arm in which robots of a kind share parameters (inner, λ = {_FREE:g}).
- **λ = {_HELD:g} keeps attention even.** The entropy's share of ln(N − 1) decides. Yes if its
  interval is above {EVEN_ENTROPY:g}. No if it is below.
"""
"""How `Answer.holds` is found, in Markdown."""


@dataclass(frozen=True)
class Answer:
    """One expectation for one situation.

    Attributes:
        claim: in a few words.
        situation: of the worlds.
        measured: what the runs show.
        holds: by `RULES`.
    """

    claim: str
    situation: str
    measured: str
    holds: Holds


def answers(situation: str, outcomes: Outcomes, effects: Sequence[Effect]) -> list[Answer]:
    """All expectations in one situation, from its runs and their `effects`."""
    halves = weights(dict.fromkeys(CREDITS, 0.5), {_FREE: 1.0, None: -1.0})
    _, free = compared_arms(outcomes, halves, "score")
    found = [
        (
            f"attention (λ = {_FREE:g}) makes sharing even under team credit",
            _makes_even(outcomes, [_FREE]),
        ),
        (
            "attention (mean over λ) makes sharing even under team credit",
            _makes_even(outcomes, PENALTIES),
        ),
        (f"attention (λ = {_FREE:g}) rescues more", _above_0(free)),
        ("attention (mean over λ) rescues more", _above_0(_effect(effects, ATTENTION, "score"))),
        ("team credit makes sharing uneven", _above_0(_effect(effects, CREDIT, "imbalance"))),
        ("team credit leaves a food robot idle with either attention", _idle_with_team(outcomes)),
        (
            "helpers credit makes sharing even with either attention",
            _even_in_all(outcomes, _by_attention("helpers")),
        ),
        (
            "shared parameters make sharing even under team credit",
            _even_in_all(outcomes, {"shared": [SHARED]}),
        ),
        (f"λ = {_HELD:g} keeps attention even", _held_even(outcomes)),
    ]
    return [Answer(claim, situation, measured, holds) for claim, (measured, holds) in found]


def idle_shown(outcomes: Outcomes, arms: Sequence[Arm]) -> str:
    """In how many seeds some run of the arms has an idle robot, and the rates that this fits."""
    idle, known = idle_seeds(outcomes, arms)
    if not known:
        return NONE
    ends = binomtest(idle, known).proportion_ci(method="wilson")
    return f"{idle} of {known} (rate {100 * ends.low:.0f} to {100 * ends.high:.0f} %)"


def idle_seeds(outcomes: Outcomes, arms: Sequence[Arm]) -> tuple[int, int]:
    """In how many seeds some run of the arms has an idle robot, and how many have all runs."""
    least = by_seed(outcomes, arms, "least_share").min(axis=1, initial=1.0)
    return int((least < IDLE).sum()), len(least)


def _mean(outcomes: Outcomes, arms: Sequence[Arm], figure: str) -> Estimate | None:
    """The mean over seeds of a result that is averaged over the arms."""
    return seed_estimate(by_seed(outcomes, arms, figure).mean(axis=1).tolist())


def _ends(mean: Estimate | None) -> tuple[float, float]:
    """The interval of a mean over enough seeds; else all numbers."""
    if mean is None or mean.runs < LEAST_SEEDS:
        return -math.inf, math.inf
    return mean.low, mean.high


def _effect(effects: Sequence[Effect], name: str, figure: str) -> Contrast | None:
    (found,) = [one.contrast for one in effects if (one.name, one.outcome) == (name, figure)]
    return found


def _above_0(found: Contrast | None) -> tuple[str, Holds]:
    """Whether a difference is above 0."""
    if found is None:
        return NONE, "undecided"
    measured = (
        f"difference {format_estimate(found.difference, 3)}, g {format_estimate(found.hedges_g, 1)}"
    )
    if found.difference.low > 0.0:
        return measured, "yes"
    return measured, "no" if found.difference.high < 0.0 or found.equivalent else "undecided"


def _makes_even(outcomes: Outcomes, penalties: Sequence[float]) -> tuple[str, Holds]:
    arms = [*(Arm("team", penalty) for penalty in penalties), Arm("team", None)]
    rows = by_seed(outcomes, arms, "imbalance")
    inner, uniform = rows[:, :-1].mean(axis=1), rows[:, -1]
    parts = (inner, uniform, inner - uniform, inner - uniform / 2.0)
    means = [seed_estimate(values.tolist()) for values in parts]
    with_, without, difference, left = map(format_estimate, means, (2, 2, 3, 2))
    holds: Holds = "undecided"
    if _ends(means[1])[0] > LEAST_UNEVEN:
        low, high = _ends(means[3])
        holds = "yes" if high < 0.0 else "no" if low > 0.0 else "undecided"
    measured = (
        f"inner {with_}, uniform {without}; difference {difference}; inner − uniform/2: {left}"
    )
    return measured if len(rows) else NONE, holds


def _by_attention(credit: Credit) -> dict[str, list[Arm]]:
    """The crossed arms of one credit by their attention."""
    arms = [arm for arm in CROSSED if arm.credit == credit]
    return {
        "inner": [arm for arm in arms if arm.penalty is not None],
        "uniform": [arm for arm in arms if arm.penalty is None],
    }


def _idle_with_team(outcomes: Outcomes) -> tuple[str, Holds]:
    groups = _by_attention("team")
    measured = "; ".join(f"{name} {idle_shown(outcomes, arms)}" for name, arms in groups.items())
    counts = [idle_seeds(outcomes, arms) for arms in groups.values()]
    if all(idle for idle, _ in counts):
        return measured, "yes"
    none = any(not idle and known >= LEAST_WITHOUT_IDLE for idle, known in counts)
    return measured, "no" if none else "undecided"


def _even_in_all(outcomes: Outcomes, groups: Mapping[str, Sequence[Arm]]) -> tuple[str, Holds]:
    """Whether sharing is even in all groups of arms, by their names."""
    means = {name: _mean(outcomes, arms, "imbalance") for name, arms in groups.items()}
    measured = "; ".join(
        f"{name} {format_estimate(means[name])}, idle {idle_shown(outcomes, arms)}"
        for name, arms in groups.items()
    )
    idle = any(idle_seeds(outcomes, arms)[0] for arms in groups.values())
    margin = MARGINS["imbalance"]
    ends = [_ends(mean) for mean in means.values()]
    if idle or any(low > margin for low, _ in ends):
        return measured, "no"
    enough = all(idle_seeds(outcomes, arms)[1] >= LEAST_WITHOUT_IDLE for arms in groups.values())
    return measured, "yes" if enough and all(high < margin for _, high in ends) else "undecided"


def _held_even(outcomes: Outcomes) -> tuple[str, Holds]:
    mean = _mean(outcomes, [Arm(credit, _HELD) for credit in CREDITS], "entropy_share")
    low, high = _ends(mean)
    measured = f"share of ln(N − 1) {format_estimate(mean, 3)}"
    if low > EVEN_ENTROPY:
        return measured, "yes"
    return measured, "no" if high < EVEN_ENTROPY else "undecided"
