"""The paper's claims beside what runs show, each decided by a rule that is fixed beforehand.

A method is judged over its runs, of which there must be at least two; the means of many rescues of
one run say nothing about the next run.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from innerattn.evaluate.comparison import compare
from innerattn.evaluate.sharing.evenness import MARGIN, Verdict
from innerattn.evaluate.sharing.printed import TEXT
from innerattn.study.fig4 import PRINTED_NATS, EntropyCourse
from innerattn.study.fig5 import Evidence
from innerattn.study.over_runs import OverRuns
from innerattn.study.table2 import PRINTED_SITUATION, Row, Table2
from innerattn.study.table2_text import NONE, share_shown, shown, verdicts_shown

Holds = Literal["yes", "no", "undecided"]

LEAST_MOVE = 0.05
"""The smallest change of a weight that counts as a move."""

RULES = f"""\
A claim is undecided for a method with less than two runs. Intervals are Student's 95 % over runs.

- *A task is shared* evenly where the runs' mean share is (its 90 % interval lies within {MARGIN[0]}
  to {MARGIN[1]}) and no run is uneven by itself; unevenly where the mean share is (its 95 %
  interval lies outside) or more than half of the runs are uneven by themselves; else it is
  undecided. Sharing is judged over all episodes.
- **Even with inner attention**: yes where all tasks are shared evenly, no where one is shared
  unevenly. **Uneven without**: yes where all tasks are shared unevenly, no where one is evenly.
- **More even with than without**: by the share's distance from 0.5, averaged over tasks. Yes
  where Welch's 95 % interval of the difference (without minus with) lies above 0; no where it lies
  below 0, or where two one-sided tests show the difference to be within ±{0.5 - MARGIN[0]:.1f}.
- **Entropy ends below that of even attention**: yes where the interval of the mean over robots,
  heads and the last tenth of training lies below ln(N − 1); any attention that is not even does.
- **Entropy falls throughout training**: by the last minus the first tenth of the logged times. Yes
  where its interval lies below 0, no where it lies above. What happens before the first logged time
  is not in it.
- **Attention moves to the next partner**: by the mean weight on the partner-to-be after the first
  rescue minus that before. Yes where its interval lies above 0 and its mean is {LEAST_MOVE} or
  more; no where its interval lies below {LEAST_MOVE}.
- **…and does so for the robot that hands over**: by that change minus the change of the food robot
  that takes no part. Yes where its interval lies above 0 and its mean is at least half the change;
  no where its interval lies below half the change, so that most of the change is shared by the
  robot that takes no part; only asked where attention moves.
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


def sharing_claims(table: Table2) -> list[Claim]:
    """Whether work is shared evenly with inner attention, and unevenly without."""
    rows: dict[tuple[str, str], list[Row]] = {}
    for row in table.rows:
        rows.setdefault((row.situation, row.method), []).append(row)
    claims = []
    for (situation, method), own in rows.items():
        if not method.endswith(("-inner", "-uniform")):
            continue
        verdicts = [judged(row) for row in own]
        inner = method.endswith("-inner")
        wanted, other = ("even", "uneven") if inner else ("uneven", "even")
        claims.append(
            Claim(
                claim="even sharing with inner attention" if inner else "uneven sharing without",
                situation=situation,
                method=method,
                printed="; ".join(_printed_share(row) for row in own),
                measured="; ".join(_measured_share(row) for row in own),
                runs=len(own[0].seeds),
                holds=_all_or_one(verdicts, wanted, other),
            )
        )
        without = rows.get((situation, method.replace("-inner", "-uniform")))
        if inner and without:
            claims.append(_contrast(own, without))
    return claims


def judged(row: Row) -> Verdict:
    """How a task is shared, over all episodes of all runs, by `RULES`."""
    verdicts, together = row.scored.verdicts(), row.scored.together
    if together is None:
        return "undecided"
    if together.verdict == "even" and not verdicts["uneven"]:
        return "even"
    many = 2 * verdicts["uneven"] > len(row.seeds)
    return "uneven" if many or together.verdict == "uneven" else "undecided"


def entropy_claims(courses: Sequence[EntropyCourse]) -> list[Claim]:
    """Whether attention becomes and stays selective in training."""
    claims = []
    for course in courses:
        if not course.chooses:
            continue
        end, change = course.end, course.change
        own = {"situation": course.situation, "method": course.method, "runs": len(course.seeds)}
        below = _decided(end, yes_below=course.even_nats)
        claims += [
            Claim(
                claim="entropy ends below that of even attention",
                printed=_printed(
                    course.situation, f"about {PRINTED_NATS} of {math.log(3):.2f} nats"
                ),
                measured=f"{shown(end)} of {course.even_nats:.2f} nats",
                holds=below,
                **own,  # type: ignore[arg-type]
            ),
            Claim(
                claim="entropy falls throughout training",
                printed=_printed(
                    course.situation, f"falls continually to about {PRINTED_NATS} nats"
                ),
                measured=f"from {course.begin.mean:.2f} to {end.mean:.2f} nats: {shown(change)}",
                holds=_decided(change, yes_below=0.0, no_above=0.0),
                **own,  # type: ignore[arg-type]
            ),
        ]
    return claims


def handover_claims(found: Sequence[Evidence]) -> list[Claim]:
    """Whether attention passes on with the work, and whether it is that of who hands over."""
    claims = []
    for part in found:
        change, own = part.robot["to_be"].change, part.own_part
        control = part.control["to_be"].change
        moves = handover_moves(change)
        about = {"situation": part.situation, "method": part.method, "runs": len(part.seeds)}
        claims += [
            Claim(
                claim="attention moves to the next partner",
                printed=_printed(
                    part.situation, "rises on the next, falls on the last (one episode)"
                ),
                measured=f"on the next {shown(change)}, on the last "
                f"{shown(part.robot['before'].change)} ({sum(part.handovers):,} hand-overs)",
                holds=moves,
                **about,  # type: ignore[arg-type]
            ),
            Claim(
                claim="…and does so for the robot that hands over",
                printed=_printed(part.situation, "taken for granted"),
                measured=f"{shown(own)} more than the robot that takes no part ({shown(control)})",
                holds=handover_is_own(change, own) if moves == "yes" else "undecided",
                **about,  # type: ignore[arg-type]
            ),
        ]
    return claims


def handover_moves(change: OverRuns | None) -> Holds:
    """Whether the weight on the partner-to-be rises, by `RULES`."""
    if change is None or change.low is None or change.high is None:
        return "undecided"
    if change.low > 0.0 and change.mean >= LEAST_MOVE:
        return "yes"
    return "no" if change.high < LEAST_MOVE else "undecided"


def handover_is_own(change: OverRuns | None, own: OverRuns | None) -> Holds:
    """Whether most of the rise is of the robot that hands over, by `RULES`."""
    if change is None or own is None or own.low is None or own.high is None:
        return "undecided"
    if own.low > 0.0 and own.mean >= change.mean / 2.0:
        return "yes"
    return "no" if own.high < change.mean / 2.0 else "undecided"


def _printed(situation: str, text: str) -> str:
    return text if situation == PRINTED_SITUATION else NONE


def _all_or_one(verdicts: Sequence[Verdict], wanted: str, other: str) -> Holds:
    if all(verdict == wanted for verdict in verdicts):
        return "yes"
    return "no" if other in verdicts else "undecided"


def _decided(value: OverRuns, yes_below: float, no_above: float | None = None) -> Holds:
    if value.low is None or value.high is None:
        return "undecided"
    if value.high < yes_below:
        return "yes"
    return "no" if no_above is not None and value.low > no_above else "undecided"


def _printed_share(row: Row) -> str:
    if row.printed is None:
        return f"{row.task}: {NONE}"
    first, second = row.printed.row.shares
    stated = TEXT.get((row.method, row.task))
    text = f" (text: {stated[0]:.2f} / {stated[1]:.2f})" if stated else ""
    return f"{row.task}: {first:.2f} / {second:.2f}{text}"


def _measured_share(row: Row) -> str:
    return f"{row.task}: {share_shown(row.scored)}, runs {verdicts_shown(row.scored)}"


def _unevenness(rows: Sequence[Row]) -> list[float]:
    """|share - 0.5| averaged over tasks, one value per run that has rescues of every task."""
    by_run = zip(*(row.scored.each for row in rows), strict=True)
    shares = [[task.share.mean for task in run if task.share] for run in by_run]
    full = [run for run in shares if len(run) == len(rows)]
    return [float(np.mean(np.abs(np.array(run) - 0.5))) for run in full]


def _contrast(inner: Sequence[Row], uniform: Sequence[Row]) -> Claim:
    with_, without = _unevenness(inner), _unevenness(uniform)
    enough = len(with_) > 1 and len(without) > 1
    found = compare(without, with_, 0.5 - MARGIN[0], 0) if enough else None
    holds: Holds = "undecided"
    measured = f"distance from 0.5: {_mean(with_)} with, {_mean(without)} without"
    if found is not None:
        measured += f"; difference {shown(found.difference)}"
        if found.difference.low > 0.0:
            holds = "yes"
        elif found.difference.high < 0.0 or found.equivalent:
            holds = "no"
    printed = "; ".join(
        f"{row.task}: {_distance(row)} with, {_distance(other)} without"
        for row, other in zip(inner, uniform, strict=True)
    )
    return Claim(
        claim="more even with inner attention than without",
        situation=inner[0].situation,
        method=f"{inner[0].method}, {uniform[0].method}",
        printed=printed,
        measured=measured,
        runs=min(len(with_), len(without)),
        holds=holds,
    )


def _distance(row: Row) -> str:
    return f"{abs(row.printed.row.shares[0] - 0.5):.2f}" if row.printed else NONE


def _mean(values: Sequence[float]) -> str:
    return f"{np.mean(values):.2f}" if values else NONE
