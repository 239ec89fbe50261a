"""Tables of how well runs do, and of what stands beside Table II."""

from __future__ import annotations

from collections.abc import Sequence

from innerattn.experiments.paper.competence import Competence, competence_units
from innerattn.experiments.paper.imbalance_score import ImbalanceScoreCorrelation
from innerattn.experiments.paper.pairs import MARGINS, Pair, Together
from innerattn.measures.registry import MEASURES
from innerattn.policies import SCRIPTED
from innerattn.report.table import Column, Row, Table, columns, plain_table
from innerattn.stats.text import NONE, format_estimate, format_number, format_p, format_signed


def competence_terms() -> str:
    """What the columns of `competence_table` mean, as a list."""
    meant = [
        f"- **{_words(name)}**: {MEASURES[name].meaning}"
        for name in competence_units()
        if name in MEASURES and MEASURES[name].needs
    ]
    return (
        "Choices of robots and times:\n\n"
        + "\n".join(meant)
        + "\n\nThese are of the episodes recorded step by step; of scripted "
        "policies, which stand last, that is all episodes.\n"
    )


def competence_table(parts: Sequence[Competence]) -> Table:
    """A row for each run and one for the mean; of scripted policies the mean alone."""
    units = competence_units()
    heads = [*columns(["method"], ["seed"])]
    heads += [Column(_words(name), "s" if unit == "s" else "") for name, unit in units.items()]
    rows: list[Row] = []
    for part in parts:
        several, scripted = len(part.seeds) > 1, part.method in SCRIPTED
        if not (several and scripted):  # what learns nothing differs by its worlds alone
            rows += [
                Row((part.method, str(seed), *(_value(values[name]) for name in units)))
                for seed, values in zip(part.seeds, part.each, strict=True)
            ]
        if several:
            means = (format_estimate(part.mean[name]) for name in units)
            rows.append(Row((part.method, "mean [95 %]", *means), strong=True))
    return plain_table(heads, rows)


def pairs_table(pairs: Sequence[Pair]) -> Table:
    """Learnt beside uniform attention, seed by seed."""
    heads = (
        *columns(["situation", "algorithm", "result"], ["seeds", "inner", "uniform"]),
        *columns([], ["inner − uniform [95 %]", "p", "margin"]),
        *columns(["alike?"]),
    )
    rows = []
    for pair in pairs:
        cells = [pair.situation, pair.algorithm.upper(), _words(pair.measure), str(len(pair.seeds))]
        cells += [format_estimate(pair.inner), format_estimate(pair.uniform)]
        found = pair.contrast
        if found is None:
            rows.append([*cells, *[NONE] * 4])
            continue
        alike = "yes" if found.equivalent else "not shown"
        cells += [
            format_estimate(found.difference, 3),
            format_p(found.p),
            f"{found.margin:g}",
            alike,
        ]
        rows.append(cells)
    return plain_table(heads, rows)


def pairs_summary(pairs: Sequence[Pair]) -> Table:
    """The differences alone, a row for each situation and algorithm."""
    heads = [*columns(["situation", "algorithm"])]
    for name, margin in MARGINS.items():
        heads.append(Column(f"{_words(name)}: inner − uniform [95 %]"))
        heads.append(Column(f"alike within {margin:g}?", right=False))
    rows: dict[tuple[str, str], list[str]] = {}
    for pair in pairs:
        cells = rows.setdefault((pair.situation, pair.algorithm), [])
        found = pair.contrast
        cells.append(format_estimate(found.difference if found else None, 3))
        cells.append(NONE if found is None else "yes" if found.equivalent else "not shown")
    return plain_table(heads, [[s, a.upper(), *cells] for (s, a), cells in rows.items()])


def together_table(found: Sequence[Together]) -> Table:
    """Learnt beside uniform attention over all situations."""
    heads = columns(["algorithm", "situations"], ["inner", "uniform", "P(inner scores higher)"])
    return plain_table(
        heads,
        [
            [
                *(one.algorithm.upper(), ", ".join(one.situations)),
                *(
                    format_estimate(one.inner),
                    format_estimate(one.uniform),
                    format_estimate(one.better),
                ),
            ]
            for one in found
        ],
    )


def imbalance_score_table(found: Sequence[ImbalanceScoreCorrelation]) -> Table:
    """Whether uneven runs score more."""
    heads = columns(["situation"], ["runs", "correlation", "p", "imbalance of hungarian"])
    rows = []
    for one in found:
        correlation = NONE if one.correlation is None else format_signed(one.correlation)
        rows.append(
            [one.situation, str(one.runs), correlation, format_p(one.p), _value(one.script[0])]
        )
    return plain_table(heads, rows)


def _value(value: float | None) -> str:
    return NONE if value is None else format_number(value)


def _words(name: str) -> str:
    return name.removesuffix("_s").replace("_", " ")
