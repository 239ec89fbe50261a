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
from innerattn.experiments.paper.pairs import LEAST_PAIRS
from innerattn.experiments.paper.table2 import PRINTED_SITUATION
from innerattn.experiments.run import OfMethod
from innerattn.measures.sharing.evenness import MARGIN
from innerattn.stats import Estimate
from innerattn.stats.text import NONE, format_estimate, format_number, format_signed

Holds = Literal["yes", "no", "undecided"]

EVEN_WITH = "inner attention shares work evenly"
UNEVEN_WITHOUT = "uniform attention shares work unevenly"
MORE_EVEN = "inner attention is more even than uniform"
ENDS_BELOW = "entropy ends below that of uniform attention"
FALLS = "entropy falls in training"
MOVES = "attention moves to the next partner"
MOVES_MORE = "attention moves more than the bystander's"
CLAIMS = (EVEN_WITH, UNEVEN_WITHOUT, MORE_EVEN, ENDS_BELOW, FALLS, MOVES, MOVES_MORE)
"""All claims in the order of tables."""

LEAST_MOVE = 0.05
"""The smallest change of a weight that counts as a move."""

ENTROPY_MARGIN = 0.02
"""The largest difference of an entropy's share of ln(N - 1) that counts as none."""

EVEN_ENTROPY = 1.0 - ENTROPY_MARGIN
"""Attention whose entropy is a larger share of ln(N - 1) than this counts as even."""

RULES = f"""\
- **Runs.** A method with fewer than two runs decides nothing. Intervals are Student's 95 % over
  runs, also where they reach impossible values, such as a share above 1. Each claim is tested by
  itself at 5 %; nothing is adjusted for their number.
- **A task is shared evenly** if the 90 % interval of the runs' mean share is within {MARGIN[0]} to
  {MARGIN[1]} and no single run is uneven. It is shared **unevenly** if the 95 % interval of the
  mean share is outside, or if more than half of the runs are uneven by themselves. Otherwise, and
  if a run has no rescue of the task, it is undecided. All episodes of the standard length count.
- **Inner attention shares work evenly**: yes if all tasks are shared evenly, no if one is shared
  unevenly. **Uniform attention shares work unevenly**: yes if all tasks are shared unevenly, no if
  one is shared evenly.
- **Inner attention is more even than uniform**: the imbalance of inner minus uniform decides, seed
  by seed, with at least {LEAST_PAIRS} seeds. Yes if its interval is below 0. No if it is above 0,
  or if two one-sided tests put it within ±{0.5 - MARGIN[0]:.1f}. Such a no does not rule out
  smaller gains. Where uniform attention is itself nearer to even than that, it refutes a gain as
  large as the paper's and nothing else.
- **Entropy ends below that of uniform attention**: the mean over robots, heads and the last tenth
  of training decides, as a share of ln(N − 1). Yes if its interval is below {EVEN_ENTROPY:g}, no if
  it is above.
- **Entropy falls in training**: the last tenth of the logged times minus the first tenth decides.
  Yes if its interval is below 0 and its mean falls by {ENTROPY_MARGIN:g} ln(N − 1) or more. No if
  the interval is above such a fall. What happens before the first logged time does not count.
- **Attention moves to the next partner**: the mean weight on the next partner after the first
  rescue, minus that before, decides. Yes if its interval is above 0 and its mean is {LEAST_MOVE} or
  more. No if the interval is below {LEAST_MOVE}.
- **Attention moves more than the bystander's**: that change minus the change of the bystander
  decides, the other food robot, over handoffs during which it rescues nobody. Yes if the interval
  is above 0 and the mean is at least half the change. No if the interval of this difference minus
  half the change is below 0: then the bystander shows most of the change, too. Asked only where
  attention moves.
"""
"""How `Claim.holds` is found, in Markdown."""


@dataclass(frozen=True)
class Claim:
    """One claim for one situation and method.

    Attributes:
        claim: in a few words.
        situation: of the worlds.
        method: of training.
        printed: what the paper prints; `NONE` in other situations than `PRINTED_SITUATION`.
        printed_brief: the same in a word or two.
        measured: what the runs show.
        brief: the same in one or two numbers.
        runs: how many.
        holds: by `RULES`.
    """

    claim: str
    situation: str
    method: str
    printed: str
    printed_brief: str
    measured: str
    brief: str
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
            claim_about(
                course,
                ENDS_BELOW,
                (f"about {PRINTED_NATS} of {math.log(3):.2f} nats", f"{PRINTED_NATS} nats"),
                f"{format_estimate(end)} of {even:.2f} nats",
                f"{format_number(end.mean)} nats",
                _decided(end, EVEN_ENTROPY * even),
            ),
            claim_about(
                course,
                FALLS,
                (f"falls to about {PRINTED_NATS} nats", "falls"),
                f"from {begin.mean:.2f} to {end.mean:.2f} nats: {format_estimate(change)}",
                f"{format_signed(change.mean)} nats",
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
            claim_about(
                part,
                MOVES,
                ("rises on the next partner, falls on the last", "rises"),
                f"next partner {format_estimate(change)}, last partner {format_estimate(before)} "
                f"({sum(part.handoffs):,} handoffs)",
                format_signed(change.mean) if change else NONE,
                moves,
                part.runs,
            ),
            claim_about(
                part,
                MOVES_MORE,
                ("taken for granted", NONE),
                f"{format_estimate(own)} more than the bystander ({format_estimate(control)}), "
                f"of at most {format_estimate(part.ceiling)}",
                format_signed(own.mean) if own else NONE,
                handoff_is_own(part) if moves == "yes" else "undecided",
                part.runs,
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


def claim_about(
    found: OfMethod,
    claim: str,
    printed: tuple[str, str],
    measured: str,
    brief: str,
    holds: Holds,
    runs: int | None = None,
) -> Claim:
    """A claim about a situation and method; the paper's words stand beside one situation only.

    Args:
        found: what it is about; ``runs`` says over how many, if not over all of its seeds.
        claim: one of `CLAIMS`.
        printed: what the paper prints, and the same in a word or two.
        measured: what the runs show.
        brief: the same in one or two numbers.
        holds: by `RULES`.
        runs: see ``found``.
    """
    known = found.situation == PRINTED_SITUATION
    return Claim(
        claim=claim,
        situation=found.situation,
        method=found.method,
        printed=printed[0] if known else NONE,
        printed_brief=printed[1] if known else NONE,
        measured=measured,
        brief=brief,
        runs=len(found.seeds) if runs is None else runs,
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
