"""Fig. 5's evidence, attention around all handoffs: as tables, and as what is drawn."""

from __future__ import annotations

from collections.abc import Sequence

from innerattn.experiments.paper.fig5 import Evidence
from innerattn.report.table import Row, Table, columns, plain_table
from innerattn.stats.text import NONE, format_estimate, format_p, format_signed

_NEXT = ("change on the next partner", "bystander's", "difference", "ceiling")
_MORE = ("difference − half the change", "change on the last partner", "bystander's")


def evidence_summary(found: Sequence[Evidence]) -> Table:
    """Means over the runs of each situation and method."""
    heads = columns(["situation", "method"], ["handoffs of all", *_NEXT])
    return plain_table(heads, [_means(part)[: len(heads)] for part in found])


def evidence_table(found: Sequence[Evidence]) -> Table:
    """Every run, and the means."""
    heads = columns(
        ["situation", "method"],
        ["seed", "handoffs of all", "episodes", *_NEXT, *_MORE, "p", "bystander's p"],
    )
    rows: list[Row] = []
    for part in found:
        rows += [_run(part, index) for index in range(len(part.seeds))]
        if len(part.seeds) > 1:
            situation, method, handoffs, *changes = _means(part)
            cells = (situation, method, "mean [95 %]", handoffs, str(sum(part.episodes)))
            rows.append(Row((*cells, *changes, NONE, NONE), strong=True))
    return plain_table(heads, rows)


def _means(part: Evidence) -> list[str]:
    to_be, control = part.robot["to_be"], part.control["to_be"]
    before, before_control = part.robot["before"], part.control["before"]
    used = sum(part.handoffs)
    return [
        *(part.situation, part.method, f"{used:,} of {used + sum(part.left_out):,}"),
        *map(format_estimate, (to_be.change, control.change, part.own_part, part.ceiling)),
        *map(format_estimate, (part.own_part_beyond_half, before.change, before_control.change)),
    ]


def _run(part: Evidence, index: int) -> Row:
    to_be, control = part.robot["to_be"], part.control["to_be"]
    before, before_control = part.robot["before"], part.control["before"]
    changes = [to_be.change_by_run, control.change_by_run, part.own_part_by_run]
    used = part.handoffs[index]
    last = [before.change_by_run, before_control.change_by_run]
    return Row(
        (
            *(part.situation, part.method, str(part.seeds[index])),
            *(f"{used} of {used + part.left_out[index]}", str(part.episodes[index])),
            *(_signed(values[index]) for values in changes),
            *(NONE, NONE),
            *(_signed(values[index]) for values in last),
            *(format_p(part.p_by_run[index]), format_p(part.control_p_by_run[index])),
        )
    )


def shift_sentence(part: Evidence) -> str:
    """How much of the shift to the next partner a bystander shows too, in one sentence."""
    change, control, own = part.robot["to_be"].change, part.control["to_be"].change, part.own_part
    if change is None or control is None or own is None:
        return "No handoff tells how the weights shift."
    if round(change.mean, 2) <= 0.0:
        return (
            "After the first rescue the weight on the next partner does not rise "
            f"({format_signed(change.mean)}), so nothing singles it out."
        )
    opening = (
        f"After the first rescue the weight on the next partner rises by {format_estimate(change)}"
    )
    bystander = f"a bystander's weight on it by {format_estimate(control)}"
    if control.mean <= 0.0:
        signed = format_signed(control.mean)
        return (
            f"{opening}, a bystander's weight on it does not ({signed}): the whole shift singles "
            "out the partner."
        )
    if own.mean <= 0.0:
        return f"{opening}, {bystander}: nothing singles out the partner."
    shared = f"{100.0 * control.mean / change.mean:.0f} %"
    apart = f"{100.0 * own.mean / change.mean:.0f} %"
    doubt = ", whose interval includes 0," if own.low <= 0.0 and own.bounded else ""
    return (
        f"{opening}, {bystander}: {shared} of the shift is the bystander's too, and {apart} "
        f"({format_estimate(own)}){doubt} singles out the partner."
    )


def _signed(value: float | None) -> str:
    return NONE if value is None else format_signed(value)
