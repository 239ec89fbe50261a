"""Learnt attention beside other critics: differences by seed, verdicts by the rules, the files."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from innerattn.experiments.attention.arms import METHODS, SITUATIONS
from innerattn.experiments.attention.study import RULES, read_attention
from innerattn.experiments.plan import plan
from innerattn.experiments.run import FinishedRun
from innerattn.report.attention.page import score_panels
from innerattn.report.attention.write import FILES, write_attention
from innerattn.stats.comparison import holm


def scored(
    run: FinishedRun, situation: str, method: str, seed: int, score: float, long: float
) -> FinishedRun:
    """A run of another method and seed, with other scores."""
    (one,) = plan((method,), (situation,), (seed,), "fast", Path("study"))
    summary = {
        **run.summary,
        "score": {"mean": score},
        "long": {**run.summary["long"], "score": {"mean": long}},
    }
    return replace(run, case=one.case, config=one.config, summary=summary)


def study(run: FinishedRun, seeds: int = 6) -> list[FinishedRun]:
    """All methods in two situations; uniform is worse, mappo alike, frozen scattered."""
    rng = np.random.default_rng(0)
    lacks = {"ppo-uniform": (0.1, 0.005), "mappo": (0.0, 0.005), "ppo-frozen": (0.0, 0.2)}
    found = []
    for situation in ("mixed", "mixed-8"):
        inner = rng.normal(0.9, 0.01, seeds)
        for method in METHODS[:4]:
            mean, scatter = lacks.get(method, (0.0, 0.0))
            scores = inner - mean + scatter * rng.standard_normal(seeds)
            for seed, score in enumerate(scores):
                found.append(scored(run, situation, method, seed, score, -score))
    return found


def test_differences_and_verdicts_follow_the_rules(runs: list[FinishedRun]) -> None:
    made = study(runs[0])
    found = read_attention(made)
    assert [(one.situation, one.other) for one in found.comparisons] == [
        (situation, other) for situation in ("mixed", "mixed-8") for other in METHODS[1:4]
    ]
    expected = []
    for one in found.comparisons:
        both = {
            method: [
                run.summary["score"]["mean"]
                for run in made
                if (run.situation, run.method) == (one.situation, method)
            ]
            for method in (METHODS[0], one.other)
        }
        expected.append(stats.ttest_rel(both[METHODS[0]], both[one.other]).pvalue)
        assert one.difference is not None
        assert one.difference.p == pytest.approx(expected[-1])
    assert [one.holm_p for one in found.comparisons] == pytest.approx(holm(expected))
    assert [one.verdict for one in found.comparisons] == ["better", "alike", "undecided"] * 2
    assert [one.verdict for one in found.long_comparisons] == ["worse", "alike", "undecided"] * 2


def test_few_seeds_and_a_missing_arm_make_no_comparison(runs: list[FinishedRun]) -> None:
    made = study(runs[0], seeds=2)
    assert read_attention(made).comparisons == ()
    others = [run for run in study(runs[0]) if run.method != "ppo-inner"]
    assert read_attention(others).comparisons == ()
    assert len(read_attention(others).learnt) == 6


def test_the_study_is_of_teams_of_three_sizes() -> None:
    sizes = [
        plan(METHODS[:1], (situation,), (0,), "fast", Path("study"))[0].config.scenario.num_robots
        for situation in SITUATIONS
    ]
    assert sizes == [4, 8, 16]


def test_a_panel_has_the_methods_that_were_run_there(runs: list[FinishedRun]) -> None:
    made = [
        run
        for run in study(runs[0])
        if (run.situation, run.method) not in {("mixed-8", "mappo"), ("mixed-8", "ppo-frozen")}
    ]
    rows = score_panels(read_attention(made))
    drawn = {row[0].situation: [[arm.name for arm in panel.arms] for panel in row] for row in rows}
    assert drawn == {"mixed": [[*METHODS[:4]]] * 2, "mixed-8": [[*METHODS[:2]]] * 2}
    (short, long), _ = rows
    scores = [run.summary["score"]["mean"] for run in made if run.method == METHODS[0]][:6]
    assert short.arms[0].values == pytest.approx(scores)
    assert long.arms[0].values == pytest.approx([-score for score in scores])


def test_files_are_the_same_twice_and_say_the_rules(
    runs: list[FinishedRun], tmp_path: Path
) -> None:
    first, second = ({}, {})
    for files in (first, second):
        write_attention(study(runs[0]), tmp_path, "fast", ["mixed mappo seed 9: failed"])
        files.update({path.name: path.read_bytes() for path in tmp_path.iterdir()})
    assert first == second
    assert set(first) == set(FILES)
    page = first["attention.md"].decode()
    assert "- mixed mappo seed 9: failed" in page
    assert "`ppo-inner` − `ppo-uniform`" in page
    assert "two one-sided tests at 5 %" in page
    document = json.loads(first["attention.json"])
    assert len(document["comparisons"]) == 6
    assert document["margin"] == 0.03


def test_the_page_has_the_rules_that_decide() -> None:
    page = Path(__file__).parents[3] / "docs" / "attention.md"
    assert " ".join(RULES.split()) in " ".join(page.read_text("utf-8").split())
