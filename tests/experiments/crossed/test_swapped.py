"""Runs whose food robots swap their initial weights: what is planned, found and written."""

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from markdown_rows import rows_of
from small_study import planned_of

from innerattn.experiments.crossed import swapped
from innerattn.experiments.crossed.swapped import read_swaps
from innerattn.experiments.run import FinishedRun
from innerattn.report.crossed.swapped import FILES, write

METHODS = ("td-uniform", "td-inner")


def made(run: FinishedRun, shares: dict[str, list[float | None]], out: Path) -> list[FinishedRun]:
    """Runs in single, by variant and seed; the share of each stands in its summary."""
    found = []
    for one in planned_of("swapped", ("td-uniform",), ("single",), 4):
        own = shares[one.case.variant]
        if one.case.seed < len(own):
            summary = {**run.summary, "first_share": own[one.case.seed]}
            found.append(
                replace(
                    run, case=one.case, config=one.config, folder=out / one.key, summary=summary
                )
            )
    return found


@pytest.fixture(autouse=True)
def _shares_of_summaries(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        swapped, "outcome_of", lambda run: SimpleNamespace(first_share=run.summary["first_share"])
    )


def test_each_run_has_one_beside_it_that_differs_in_the_swap_alone() -> None:
    planned = planned_of("swapped", METHODS, ("single", "mixed"), 2)
    assert len(planned) == 16
    crossed = {one.key for one in planned_of("crossed", METHODS, ("single", "mixed"), 2)}
    drawn = {one.case: one for one in planned if one.key in crossed}
    assert len(drawn) == 8
    for other in (one for one in planned if one.key not in crossed):
        assert other.config.network.swapped_robots == ("food_0", "food_1")
        case = replace(other.case, variant=other.case.variant.removesuffix("-swapped"))
        network = other.config.network.model_copy(update={"swapped_robots": None})
        assert other.config.model_copy(update={"network": network}) == drawn[case].config


@pytest.mark.parametrize(
    ("other", "answer", "sign"),
    [
        ([0.71, 0.41, 0.52, 0.29], "the weights", -1.0),
        ([0.31, 0.59, 0.48, 0.72], "something else", 1.0),
        ([0.50, 0.51, 0.49, 0.50], "undecided", None),
    ],
)
def test_the_correlation_decides(
    other: list[float | None],
    answer: str,
    sign: float | None,
    crossed_study: tuple[Path, list[FinishedRun]],
) -> None:
    drawn: list[float | None] = [0.3, 0.6, 0.47, 0.7]
    runs = made(crossed_study[1][0], {"team": drawn, "team-swapped": other}, Path("study"))
    (found,) = read_swaps(runs[::-1])
    assert found.answer == answer
    assert [(one.drawn, one.swapped) for one in found.pairs] == list(zip(drawn, other, strict=True))
    assert found.correlation is not None
    covariance = np.cov(np.array([drawn, other], float))
    plain = 2.0 * covariance[0, 1] / np.trace(covariance)  # of two columns, ICC(3,1) is this
    assert found.correlation.mean == pytest.approx(plain)
    assert sign is None or np.sign(plain) == sign


def test_two_pairs_decide_nothing(crossed_study: tuple[Path, list[FinishedRun]]) -> None:
    shares = {"team": [0.3, 0.7, None, 0.5], "team-swapped": [0.7, 0.3, 0.5]}
    (found,) = read_swaps(made(crossed_study[1][0], shares, Path("study")))
    assert [one.seed for one in found.pairs] == [0, 1]
    assert (found.correlation, found.answer) == (None, "undecided")


def test_the_page_has_every_pair(
    crossed_study: tuple[Path, list[FinishedRun]], tmp_path: Path
) -> None:
    shares = {"team": [0.3, 0.6, 0.47, 0.7], "team-swapped": [0.71, 0.41, 0.52, 0.29]}
    runs = made(crossed_study[1][0], shares, tmp_path)
    write(runs, tmp_path, "short", ["single td-uniform team seed 9: failed"])
    before = {name: (tmp_path / name).read_bytes() for name in FILES}
    write(runs, tmp_path, "short", ["single td-uniform team seed 9: failed"])
    assert {name: (tmp_path / name).read_bytes() for name in FILES} == before
    text = before["swapped.md"].decode()
    assert "team seed 9: failed" in text
    rows = rows_of(text)
    assert ["single", "td-uniform", "3", "0.70", "0.29"] in rows
    assert rows[1][:3] == ["single", "td-uniform", "4"]
    assert rows[1][4] == "the weights"
    document = json.loads(before["swapped.json"])
    assert len(document["runs"]) == 8
    assert len(document["swaps"][0]["pairs"]) == 4
