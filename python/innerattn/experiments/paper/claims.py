"""The paper's claims beside what runs show, each decided by a rule that is fixed beforehand.

A method is judged over its runs, of which there must be at least two; the means of many rescues of
one run say nothing about the next run.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from innerattn.experiments.paper.fig4 import PRINTED_NATS, EntropyCourse
from innerattn.experiments.paper.fig5 import Evidence
from innerattn.experiments.paper.table2 import PRINTED_SITUATION
from innerattn.measures.sharing.evenness import MARGIN
from innerattn.stats import Estimate
from innerattn.stats.text import NONE, format_estimate

Holds = Literal["yes", "no", "undecided"]

LEAST_PAIRS = 3
"""Two methods are compared over so many seeds that have a run of each, or not at all."""

LEAST_MOVE = 0.05
"""The smallest change of a weight that counts as a move."""

ENTROPY_MARGIN = 0.02
"""The largest difference of an entropy's share of ln(N - 1) that counts as none."""

EVEN_ENTROPY = 1.0 - ENTROPY_MARGIN
"""Attention whose entropy is a larger share of ln(N - 1) than this counts as even."""

RULES = f"""\
A claim is undecided for a method with less than two runs. Intervals are Student's 95 % over runs,
also where they reach beyond what is possible (a share above 1, an imbalance below 0). Every claim
is judged by itself at 5 %; nothing is adjusted for their number.

- *A task is shared* evenly where the runs' mean share is (its 90 % interval lies within {MARGIN[0]}
  to {MARGIN[1]}) and no run is uneven by itself; unevenly where the mean share is (its 95 %
  interval lies outside) or more than half of the runs are uneven by themselves; else, and where a
  run has no rescue of the task, it is undecided. Sharing is judged over all episodes.
- **Even with inner attention**: yes where all tasks are shared evenly, no where one is shared
  unevenly. **Uneven without**: yes where all tasks are shared unevenly, no where one is evenly.
- **More even with than without**: by the share's distance from 0.5, averaged over tasks, with minus
  without. Runs of one seed begin alike and are measured in the same worlds, so each seed gives one
  difference; {LEAST_PAIRS} at least. Yes where the interval lies below 0; no where it lies above 0,
  or where two one-sided tests show the difference to be within ±{0.5 - MARGIN[0]:.1f}; smaller
  differences are not ruled out by that. Where the distance without is itself below that, such a no
  refutes a gain as large as the paper's, and nothing else.
- **Entropy ends below that of even attention**: by the mean over robots, heads and the last tenth
  of training, as a share of ln(N − 1). Yes where its interval lies below {EVEN_ENTROPY:g}, no where
  it lies above.
- **Entropy falls in training**: by the last minus the first tenth of the logged times. Yes where
  its interval lies below 0 and its mean is a fall by {ENTROPY_MARGIN:g} ln(N − 1) or more; no where
  the interval lies above such a fall. What happens before the first logged time is not in it.
- **Attention moves to the next partner**: by the mean weight on the partner-to-be after the first
  rescue minus that before. Yes where its interval lies above 0 and its mean is {LEAST_MOVE} or
  more; no where its interval lies below {LEAST_MOVE}.
- **…and does so for the robot that hands over**: by that change minus the change of the other food
  robot, over the handoffs during which the other one rescues nobody. Yes where its interval lies
  above 0 and its mean is at least half the change; no where the interval of that part minus half
  the change lies below 0, so that most of the change is shared by the robot that takes no part;
  only asked where attention moves.
"""
"""How `Claim.holds` is found, in Markdown."""


@dataclass(frozen=True)
class Claim:
    """One claim for one situation and method.

    Attributes:
        claim: in a few words.
        situation: of the worlds.
        method: of training.
        printed: what the paper prints.
        measured: what the runs show.
        runs: how many.
        holds: by `RULES`.
    """

    claim: str
    situation: str
    method: str
    printed: str
    measured: str
    runs: int
    holds: Holds


def entropy_claims(courses: Sequence[EntropyCourse]) -> list[Claim]:
    """Whether attention becomes and stays selective in training."""
    claims = []
    for course in courses:
        if not course.chooses:
            continue
        begin, end, change, even = course.begin, course.end, course.change, course.even_nats
        least_fall = ENTROPY_MARGIN * even
        claims += [
            _claim(
                course,
                "entropy ends below that of even attention",
                f"about {PRINTED_NATS} of {math.log(3):.2f} nats",
                f"{format_estimate(end)} of {even:.2f} nats",
                _decided(end, EVEN_ENTROPY * even),
            ),
            _claim(
                course,
                "entropy falls in training",
                f"falls continually to about {PRINTED_NATS} nats",
                f"from {begin.mean:.2f} to {end.mean:.2f} nats: {format_estimate(change)}",
                _falls(change, least_fall),
            ),
        ]
    return claims


def handoff_claims(found: Sequence[Evidence]) -> list[Claim]:
    """Whether attention passes on with the work, and whether it is that of who hands over."""
    claims = []
    for part in found:
        change, own = part.robot["to_be"].change, part.own_part
        before, control = part.robot["before"].change, part.control["to_be"].change
        moves = handoff_moves(change)
        claims += [
            _claim(
                part,
                "attention moves to the next partner",
                "rises on the next, falls on the one before",
                f"on the next {format_estimate(change)}, "
                f"on the one before {format_estimate(before)} ({sum(part.handoffs):,} handoffs)",
                moves,
            ),
            _claim(
                part,
                "…and does so for the robot that hands over",
                "taken for granted",
                f"{format_estimate(own)} more than the robot that takes no part "
                f"({format_estimate(control)}), of at most {format_estimate(part.ceiling)}",
                handoff_is_own(part) if moves == "yes" else "undecided",
            ),
        ]
    return claims


def handoff_moves(change: Estimate | None) -> Holds:
    """Whether the weight on the partner-to-be rises, by `RULES`."""
    if change is None:
        return "undecided"
    if change.low > 0.0 and change.mean >= LEAST_MOVE:
        return "yes"
    return "no" if change.high < LEAST_MOVE else "undecided"


def handoff_is_own(found: Evidence) -> Holds:
    """Whether most of the rise is of the robot that hands over, by `RULES`."""
    own, beyond_half = found.own_part, found.own_part_beyond_half
    if own is None or beyond_half is None:
        return "undecided"
    if own.low > 0.0 and beyond_half.mean >= 0.0:
        return "yes"
    return "no" if beyond_half.high < 0.0 else "undecided"


def _claim(
    found: EntropyCourse | Evidence, claim: str, printed: str, measured: str, holds: Holds
) -> Claim:
    """A claim about a situation and method; the paper's words stand beside one situation only."""
    return Claim(
        claim=claim,
        situation=found.situation,
        method=found.method,
        printed=printed if found.situation == PRINTED_SITUATION else NONE,
        measured=measured,
        runs=found.end.runs if isinstance(found, EntropyCourse) else found.runs,
        holds=holds,
    )


def _decided(value: Estimate, yes_below: float) -> Holds:
    """Yes below, no above."""
    if value.high < yes_below:
        return "yes"
    return "no" if value.low > yes_below else "undecided"


def _falls(change: Estimate, least: float) -> Holds:
    if change.high < 0.0 and change.mean <= -least:
        return "yes"
    return "no" if change.low > -least else "undecided"
