"""What was expected of the crossed design beside what its runs show, decided by fixed rules."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from scipy.stats import binomtest

from innerattn.experiments.crossed.arms import CREDITS, CROSSED, PENALTIES, SHARED, Arm, Credit
from innerattn.experiments.crossed.effects import LEAST_SEEDS, MARGINS, Effect
from innerattn.experiments.crossed.outcome import IDLE, Outcomes, by_seed
from innerattn.experiments.paper.claims import EVEN_ENTROPY, Holds
from innerattn.stats import Estimate
from innerattn.stats.seeds import seed_estimate
from innerattn.stats.text import NONE, format_estimate

LEAST_WITHOUT_IDLE = 10
"""So many seeds without an idle robot say that there is none; fewer say nothing."""

LEAST_UNEVEN = MARGINS["imbalance"] / 2.0
"""Less imbalance than this is too little to ask what takes it away."""

RULES = f"""\
The seed is the unit: runs of one seed begin with the same weights in the same worlds and are
measured in the same ones, so that they may be alike in all arms. Where several arms are put
together, or compared, every seed that has a run of each gives one number. Intervals are 95 %:
Student's over seeds, Wilson's of numbers of seeds; an effect, or a mean that decides, needs
{LEAST_SEEDS} seeds. Two means count as alike where two one-sided tests show them to be within the
margin ({MARGINS["imbalance"]:g} of imbalance, {MARGINS["score"]:g} of the score,
{MARGINS["entropy_share"]:g} of the entropy's share). The rules go by intervals of single effects;
beside each p-value of an effect stands Holm's, adjusted for all main effects of the situation on
all figures, or for all its other effects.

- **Attention makes sharing even under the team's credit**, over penalties: by inner minus half of
  uniform. Yes where its interval lies below 0, so that attention takes away more than half of the
  imbalance; no where it lies above. Only asked where there is something to take away: where
  uniform's interval lies above {LEAST_UNEVEN:g}.
- **Attention rescues more**: yes where the interval of inner minus uniform, over credits and
  penalties, lies above 0; no where it lies below, or where the two are alike.
- **The team's credit makes sharing uneven**: yes where the interval of team minus helpers, over
  attentions and penalties, lies above 0; no where it lies below, or where they are alike.
- **The team's credit leaves a food robot idle with either attention**: yes where both attentions
  have seeds with such a run (a share of the rescues below {IDLE:g}); no where one of them has none
  in at least {LEAST_WITHOUT_IDLE} seeds. A seed has one run with uniform weights and
  {len(PENALTIES)} with learnt attention, so the two numbers are not to be compared with each other.
- **With the helpers' credit sharing is even with either attention**: yes where no robot is idle in
  at least {LEAST_WITHOUT_IDLE} seeds and both intervals of the imbalance lie below
  {MARGINS["imbalance"]:g}; no where a robot is idle or one interval lies above.
- **Robots of a kind with the same parameters share evenly under the team's credit, too**: decided
  as the claim before, for the arm in which they have the same (learnt attention, no penalty).
- **The largest penalty holds attention even**: yes where the interval of the entropy's share lies
  above {EVEN_ENTROPY:g}; no where it lies below.
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
    main = {(one.figure, one.name.split(",")[0]): one for one in effects if one.main}
    asked = [
        ("attention rescues more", "score", "inner - uniform", 1.0),
        ("the team's credit makes sharing uneven", "imbalance", "team - helpers", 1.0),
    ]
    found = [
        Answer(claim, situation, *_of_effect(main[figure, name], sign))
        for claim, figure, name, sign in asked
    ]
    return [
        _makes_even(situation, outcomes),
        *found,
        _idle_with_team(situation, outcomes),
        _even_with_helpers(situation, outcomes),
        _even_if_shared(situation, outcomes),
        _held_even(situation, outcomes),
    ]


def idle_shown(outcomes: Outcomes, arms: Sequence[Arm]) -> str:
    """In how many seeds some run of the arms has an idle robot, with Wilson's interval."""
    idle, known = idle_seeds(outcomes, arms)
    if not known:
        return NONE
    ends = binomtest(idle, known).proportion_ci(method="wilson")
    return f"{idle} of {known} [{ends.low:.2f}, {ends.high:.2f}]"


def idle_seeds(outcomes: Outcomes, arms: Sequence[Arm]) -> tuple[int, int]:
    """In how many seeds some run of the arms has an idle robot, and how many have all runs."""
    least = by_seed(outcomes, arms, "least_share").min(axis=1, initial=1.0)
    return int((least < IDLE).sum()), len(least)


def _mean(outcomes: Outcomes, arms: Sequence[Arm], figure: str) -> Estimate | None:
    """The mean over seeds of a figure that is averaged over the arms."""
    return seed_estimate(by_seed(outcomes, arms, figure).mean(axis=1).tolist())


def _ends(mean: Estimate | None) -> tuple[float, float]:
    """The interval of a mean over enough seeds; else all numbers."""
    if mean is None or mean.runs < LEAST_SEEDS:
        return -math.inf, math.inf
    return mean.low, mean.high


def _of_effect(effect: Effect, sign: float) -> tuple[str, Holds]:
    """Whether an effect is on the expected side of 0."""
    found = effect.found
    if found is None:
        return NONE, "undecided"
    difference, g = format_estimate(found.difference), format_estimate(found.hedges_g, 1)
    measured = f"{effect.name}: {difference}, g {g}"
    low, high = sorted((sign * found.difference.low, sign * found.difference.high))
    if low > 0.0:
        return measured, "yes"
    return measured, "no" if high < 0.0 or found.equivalent else "undecided"


def _makes_even(situation: str, outcomes: Outcomes) -> Answer:
    groups = _by_attention("team")
    rows = by_seed(outcomes, [arm for arms in groups.values() for arm in arms], "imbalance")
    inner, uniform = rows[:, : len(groups["inner"])].mean(axis=1), rows[:, -1]
    means = [seed_estimate(values.tolist()) for values in (inner, uniform, inner - uniform / 2.0)]
    with_, without, left = (format_estimate(mean) for mean in means)
    holds: Holds = "undecided"
    if _ends(means[1])[0] > LEAST_UNEVEN:
        low, high = _ends(means[2])
        holds = "yes" if high < 0.0 else "no" if low > 0.0 else "undecided"
    claim = "attention makes sharing even under the team's credit"
    measured = f"inner: {with_}; uniform: {without}; inner - uniform / 2: {left}"
    return Answer(claim, situation, measured if len(rows) else NONE, holds)


def _by_attention(credit: Credit) -> dict[str, list[Arm]]:
    """The crossed arms of one credit by their attention."""
    arms = [arm for arm in CROSSED if arm.credit == credit]
    return {
        "inner": [arm for arm in arms if arm.penalty is not None],
        "uniform": [arm for arm in arms if arm.penalty is None],
    }


def _idle_with_team(situation: str, outcomes: Outcomes) -> Answer:
    groups = _by_attention("team")
    measured = "; ".join(f"{name}: {idle_shown(outcomes, arms)}" for name, arms in groups.items())
    counts = [idle_seeds(outcomes, arms) for arms in groups.values()]
    holds: Holds = "undecided"
    if all(idle for idle, _ in counts):
        holds = "yes"
    elif any(not idle and known >= LEAST_WITHOUT_IDLE for idle, known in counts):
        holds = "no"
    claim = "the team's credit leaves a food robot idle with either attention"
    return Answer(claim, situation, measured, holds)


def _even_with_helpers(situation: str, outcomes: Outcomes) -> Answer:
    claim = "with the helpers' credit sharing is even with either attention"
    return Answer(claim, situation, *_even_in_all(outcomes, _by_attention("helpers")))


def _even_if_shared(situation: str, outcomes: Outcomes) -> Answer:
    claim = "robots of a kind with the same parameters share evenly under the team's credit, too"
    return Answer(claim, situation, *_even_in_all(outcomes, {"shared": [SHARED]}))


def _even_in_all(outcomes: Outcomes, groups: Mapping[str, Sequence[Arm]]) -> tuple[str, Holds]:
    """Whether sharing is even in all groups of arms, by their names."""
    means = {name: _mean(outcomes, arms, "imbalance") for name, arms in groups.items()}
    measured = "; ".join(
        f"{name}: {format_estimate(means[name])}, idle {idle_shown(outcomes, arms)}"
        for name, arms in groups.items()
    )
    idle = any(idle_seeds(outcomes, arms)[0] for arms in groups.values())
    margin = MARGINS["imbalance"]
    ends = [_ends(mean) for mean in means.values()]
    if idle or any(low > margin for low, _ in ends):
        return measured, "no"
    enough = all(idle_seeds(outcomes, arms)[1] >= LEAST_WITHOUT_IDLE for arms in groups.values())
    return measured, "yes" if enough and all(high < margin for _, high in ends) else "undecided"


def _held_even(situation: str, outcomes: Outcomes) -> Answer:
    arms = [Arm(credit, PENALTIES[-1]) for credit in CREDITS]
    mean = _mean(outcomes, arms, "entropy_share")
    low, high = _ends(mean)
    holds: Holds = "undecided"
    if low > EVEN_ENTROPY:
        holds = "yes"
    elif high < EVEN_ENTROPY:
        holds = "no"
    claim = f"a penalty of {PENALTIES[-1]:g} holds attention even"
    return Answer(claim, situation, f"share of ln(N - 1): {format_estimate(mean, 3)}", holds)
