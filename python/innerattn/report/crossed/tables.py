"""The tables of the crossed design."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from innerattn.experiments.crossed.claims import idle_shown
from innerattn.experiments.crossed.effects import Effect
from innerattn.experiments.crossed.outcome import OUTCOMES
from innerattn.experiments.crossed.study import Situation
from innerattn.report.table import Column, Row, Table, columns, csv_text, plain_table
from innerattn.stats.text import NONE, format_estimate, format_number, format_p

LAMBDA = (
    "λ is the weight of the attention-logit regularisation (`td.attention_logit_penalty`). "
    "Uniform attention has no logits, so one arm stands for all λ."
)
_LABELS = {
    "imbalance": "imbalance",
    "least_share": "smaller share",
    "rescues_per_episode": "rescues per episode",
    "score": "score",
    "entropy_share": "entropy / ln(N − 1)",
    "first_share": "share of the first robot",
}
_CSV = (
    *("situation", "method", "credit", "penalty", "shared", "seed"),
    *(*OUTCOMES, "folder", "config_sha256", "weights_sha256"),
)


def claims_table(situations: Sequence[Situation]) -> Table:
    """What was expected, with the verdict of each situation below one another."""
    rows = []
    for same in zip(*(situation.answers for situation in situations), strict=True):
        for index, (situation, answer) in enumerate(zip(situations, same, strict=True)):
            claim = "" if index else answer.claim
            rows.append([claim, situation.name, answer.measured, f"**{answer.holds}**"])
    return plain_table(columns(["claim", "situation", "measured", "holds?"]), rows)


def seeds_table(situations: Sequence[Situation]) -> Table:
    """How alike the runs of one seed are in which food robot does more."""
    heads = columns(["situation", "credit"], ["seeds", "arms", "intraclass correlation [95 %]"])
    rows = []
    for situation in situations:
        for one in situation.seeds:
            ends = (one.least, one.most)
            reach = NONE if None in ends else " to ".join(map(_fixed, ends))
            counts = [str(one.seeds), str(one.arms), format_estimate(one.correlation)]
            rows.append([situation.name, one.credit, *counts, reach])
    return plain_table([*heads, Column("shares of single runs")], rows)


def arms_table(situation: Situation) -> Table:
    """What the runs of each arm show, means over seeds."""
    figures = ("imbalance", "least_share", "rescues_per_episode", "score", "entropy_share")
    numbers = [_LABELS[name] for name in figures]
    heads = columns(["arm"], ["runs", *numbers, "seeds with an idle robot"])
    rows = []
    for arm, means in situation.means.items():
        cells = [
            format_estimate(means[name], 3 if name == "entropy_share" else 2) for name in figures
        ]
        rows.append(
            [
                str(arm),
                str(len(situation.outcomes[arm])),
                *cells,
                idle_shown(situation.outcomes, [arm]),
            ]
        )
    return plain_table(heads, rows)


def effects_table(effects: Iterable[Effect]) -> Table:
    """Differences between arms; main effects are strong."""
    heads = (
        *columns(["effect", "on"], ["seeds", "difference [95 %]", "Hedges g [95 %]", "p"]),
        *columns([], ["p (Holm)", "margin"]),
        *columns(["alike?"]),
    )
    return plain_table(heads, map(_effect_row, effects))


def _effect_row(effect: Effect) -> Row:
    found = effect.contrast
    cells = [effect.name, _LABELS[effect.outcome], str(effect.seeds)]
    if found is None or effect.holm_p is None:
        return Row((*cells, *[NONE] * 6), effect.main)
    cells += [
        format_estimate(found.difference, 3),
        format_estimate(found.hedges_g, 1),
        format_p(found.p),
    ]
    cells += [
        format_p(effect.holm_p),
        f"{found.margin:g}",
        "yes" if found.equivalent else "not shown",
    ]
    return Row(tuple(cells), effect.main)


def runs_csv(situations: Sequence[Mapping[str, Any]]) -> str:
    """One line for each run of the situations of a document, `crossed_document`."""
    rows = (
        [run.get(name, situation["situation"]) for name in _CSV]
        for situation in situations
        for run in situation["runs"]
    )
    return csv_text(_CSV, rows)


def _fixed(value: float | None) -> str:
    return NONE if value is None else format_number(value)
