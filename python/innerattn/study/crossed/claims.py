"""What was expected of the crossed design beside what its runs show, decided by fixed rules."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from scipy.stats import binomtest

from innerattn.study.claims import Holds
from innerattn.study.crossed.arms import CREDITS, CROSSED, PENALTIES, SHARED, Arm, Credit
from innerattn.study.crossed.effects import MARGINS, Effect
from innerattn.study.crossed.outcome import IDLE, Outcomes, by_seed
from innerattn.study.over_runs import OverRuns, over_runs
from innerattn.study.table2_text import NONE, shown

LEAST_SEEDS = 10
"""So many seeds without an idle robot say that there is none; fewer say nothing."""

EVEN_ENTROPY = 1.0 - MARGINS["entropy_share"]
"""Attention whose entropy is a larger share of ln(N - 1) than this counts as even."""

RULES = f"""\
The seed is the unit: runs of one seed begin with the same weights in the same worlds, so that they
may be alike in all arms. Where several arms are put together, or compared, every seed that has a
run of each gives one number. Intervals are 95 %: Student's over seeds, Wilson's of numbers of
seeds; an effect needs three seeds. Two means count as alike where two one-sided tests show them to
be within the margin ({MARGINS["unevenness"]:g} of unevenness, {MARGINS["score"]:g} of the
score, {MARGINS["entropy_share"]:g} of the entropy's share). The rules go by intervals of single
effects; beside each p-value of an effect stands Holm's, adjusted for all main effects of the
situation on all figures, or for all its other effects.

- **Attention makes sharing even; attention rescues more**: yes where the interval of inner minus
  uniform, over credits and penalties, lies on that side of 0; no where it lies on the other, or
  where the two are alike.
- **The team's credit makes sharing uneven**: yes where the interval of team minus helpers, over
  attentions and penalties, lies above 0; no where it lies below, or where they are alike.
- **The team's credit leaves a food robot idle with either attention**: yes where both attentions
  have seeds with such a run (a share of the rescues below {IDLE:g}); no where one of them has none
  in at least {LEAST_SEEDS} seeds.
- **With the helpers' credit sharing is even with either attention**: yes where no robot is idle and
  both intervals of the unevenness lie below {MARGINS["unevenness"]:g}; no where a robot is idle or
  one interval lies above.
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
        ("attention makes sharing even", "unevenness", "inner - uniform", -1.0),
        ("attention rescues more", "score", "inner - uniform", 1.0),
        ("the team's credit makes sharing uneven", "unevenness", "team - helpers", 1.0),
    ]
    found = [
        Answer(claim, situation, *_of_effect(main[figure, name], sign))
        for claim, figure, name, sign in asked
    ]
    return [
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


def _mean(outcomes: Outcomes, arms: Sequence[Arm], figure: str) -> OverRuns | None:
    """The mean over seeds of a figure that is averaged over the arms."""
    return over_runs(by_seed(outcomes, arms, figure).mean(axis=1).tolist())


def _of_effect(effect: Effect, sign: float) -> tuple[str, Holds]:
    """Whether an effect is on the expected side of 0."""
    found = effect.found
    if found is None:
        return NONE, "undecided"
    measured = f"{effect.name}: {shown(found.difference)}, g {shown(found.hedges_g, 1)}"
    low, high = sorted((sign * found.difference.low, sign * found.difference.high))
    if low > 0.0:
        return measured, "yes"
    return measured, "no" if high < 0.0 or found.equivalent else "undecided"


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
    elif any(not idle and known >= LEAST_SEEDS for idle, known in counts):
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
    means = {name: _mean(outcomes, arms, "unevenness") for name, arms in groups.items()}
    measured = "; ".join(
        f"{name}: {shown(means[name])}, idle {idle_shown(outcomes, arms)}"
        for name, arms in groups.items()
    )
    idle = any(idle_seeds(outcomes, arms)[0] for arms in groups.values())
    margin = MARGINS["unevenness"]
    found = [mean for mean in means.values() if mean is not None]
    if idle or any(mean.low is not None and mean.low > margin for mean in found):
        return measured, "no"
    if len(found) == len(means) and all(
        mean.high is not None and mean.high < margin for mean in found
    ):
        return measured, "yes"
    return measured, "undecided"


def _held_even(situation: str, outcomes: Outcomes) -> Answer:
    arms = [Arm(credit, PENALTIES[-1]) for credit in CREDITS]
    mean = _mean(outcomes, arms, "entropy_share")
    holds: Holds = "undecided"
    if mean is not None and mean.low is not None and mean.low > EVEN_ENTROPY:
        holds = "yes"
    elif mean is not None and mean.high is not None and mean.high < EVEN_ENTROPY:
        holds = "no"
    claim = f"a penalty of {PENALTIES[-1]:g} holds attention even"
    return Answer(claim, situation, f"share of ln(N - 1): {shown(mean, 3)}", holds)
