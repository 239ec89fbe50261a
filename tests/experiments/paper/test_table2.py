"""Rows of Table II against hand counts, printed rows, text and CSV."""

import csv
import io
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from innerattn.errors import RunError
from innerattn.experiments.archive import keep
from innerattn.experiments.paper.table2 import Table2, table2
from innerattn.experiments.run import Measured, StudyRun, by_method, read_configs, read_measured
from innerattn.measures.dispatch_quality import dispatch_quality
from innerattn.measures.waiting import waiting
from innerattn.records.parquet import read_records
from innerattn.report.paper.table2 import markdown_table, table2_csv, table2_markdown
from innerattn.stats.student import student_interval
from innerattn.stats.text import format_number


@pytest.fixture(scope="module")
def groups(runs: list[StudyRun]) -> list[list[Measured]]:
    return [[read_measured(run) for run in group] for group in by_method(runs).values()]


@pytest.fixture(scope="module")
def table(groups: list[list[Measured]]) -> Table2:
    return table2(groups)


def counted(measured: Measured, task: int, episodes: int) -> tuple[int, int]:
    """Rescues of a task by food_0 and food_1 in the first episodes, by plain loops."""
    records = read_records(measured.run.folder / "evaluation")
    first, second = 0, 0
    for record in [r for r in records if r.policy == measured.run.method][:2]:
        for event in record.rescues:
            if event["episode"] < episodes and event["task"] == task:
                helpers = {int(event["helper_0"]), int(event["helper_1"])}
                first += 0 in helpers
                second += 1 in helpers
    return first, second


def test_rows_against_hand_counts(groups: list[list[Measured]], table: Table2) -> None:
    assert [(row.situation, row.method, row.task, row.seeds) for row in table.rows] == [
        ("mixed", "td-inner", "task_1", (0, 1, 2)),
        ("mixed", "td-inner", "task_2", (0, 1, 2)),
        ("mixed", "td-uniform", "task_1", (0, 1)),
        ("mixed", "td-uniform", "task_2", (0, 1)),
        ("single", "ppo-inner", "task_1", (0,)),
        ("single", "ppo-inner", "task_2", (0,)),
    ]
    for index, row in enumerate(table.rows):
        group, task = groups[index // 2], index % 2
        assert row.robots == ("food_0", "food_1")
        for sharing, episodes in ((row.recorded, 40), (row.scored, 60)):
            assert sharing.episodes == episodes
            by_hand = [counted(measured, task, episodes) for measured in group]
            assert [run.rescues for run in sharing.each] == by_hand
            assert sharing.all.rescues == tuple(np.sum(by_hand, 0))
            if len(group) > 1:
                shares = [first / (first + second) for first, second in by_hand]
                assert sharing.together is not None
                assert sharing.together.share == student_interval(shares)
            else:
                assert sharing.together is None
            assert sum(sharing.verdicts().values()) == len(group)


def test_printed_rows_stand_beside_mixed_runs_only(table: Table2) -> None:
    printed = [row.printed.row.chi_squared if row.printed else None for row in table.rows]
    assert printed == [0.36, 1.44, 81.9, 81.9, None, None]


def test_competence_is_that_of_the_same_runs(groups: list[list[Measured]], table: Table2) -> None:
    part, measured = table.competence[0], groups[0][1]
    figures, counts = part.each[1], part.counts[1]
    quality, waited = dispatch_quality(measured.recorded), waiting(measured.recorded)
    assert quality.sooner is not None
    assert waited.time_to_rescue_s is not None
    assert figures["sooner"] == quality.sooner.mean
    assert figures["time_to_rescue_s"] == waited.time_to_rescue_s.mean
    assert figures["rescues_per_episode"] == pytest.approx(
        sum(len(record.rescues) for record in measured.scored) / 60
    )
    assert (counts["score_episodes"], counts["episodes"]) == (60, 40)
    mean = part.mean["score"]
    assert mean is not None
    scores = [run["score"] for run in part.each]
    assert mean.mean == pytest.approx(np.mean([score for score in scores if score is not None]))
    assert not table.competence[2].mean["sooner"].bounded  # type: ignore[union-attr]


@pytest.mark.parametrize("name", ["random", "greedy", "hungarian"])
def test_scripted_policies_are_played_in_the_worlds_of_the_runs(
    name: str, groups: list[list[Measured]], table: Table2
) -> None:
    (part,) = [c for c in table.competence if (c.situation, c.method) == ("mixed", name)]
    assert part.seeds == (0, 1, 2)
    for measured, figures, counts in zip(groups[0], part.each, part.counts, strict=True):
        of_all = read_records(measured.run.folder / "evaluation")
        recorded = next(record for record in of_all if record.policy == name)
        assert figures["rescues_per_episode"] == pytest.approx(len(recorded.rescues) / 60)
        helped = [0 in (event["helper_0"], event["helper_1"]) for event in recorded.rescues]
        of_task = [np.array(helped)[recorded.rescues["task"] == task] for task in (0, 1)]
        if all(map(len, of_task)):
            uneven = np.mean([abs(each.mean() - 0.5) for each in of_task])
            assert figures["imbalance"] == pytest.approx(uneven)
        else:
            assert figures["imbalance"] is None
        assert (counts["rescued"], counts["score_episodes"]) == (len(recorded.rescues), 60)
        assert (figures["sooner"] is None) == (counts["choices"] == 0)
        rescues = {of: one["mean"] for of, one in measured.summary["scripted"].items()}
        score = (rescues[name] - rescues["random"]) / (rescues["hungarian"] - rescues["random"])
        assert figures["score"] == pytest.approx(score)
    text = table2_markdown(table)
    assert text.count(f"| {name} | mean [95 %] |") == 1
    assert text.count(f"| {name} | 0 |") == 1  # of the single run in single


def test_small_copies_of_runs_are_enough_for_sharing_and_scores(
    runs: list[StudyRun], table: Table2, tmp_path: Path
) -> None:
    small = []
    for run in runs[:3]:
        keep(run, tmp_path / run.folder.name)
        small.append(replace(run, folder=tmp_path / run.folder.name))
    ordered = [
        read_measured(run, step_by_step=False) for run in by_method(small)["mixed", "td-inner"]
    ]
    of_copies = table2([ordered])
    assert [row.to_json() for row in of_copies.rows] == [row.to_json() for row in table.rows[:2]]
    for whole, copy in zip(table.competence[0].each, of_copies.competence[0].each, strict=True):
        for name in ("rescues_per_episode", "score", "imbalance"):
            assert copy[name] == whole[name]
        assert copy["sooner"] is copy["regret_s"] is copy["time_to_rescue_s"] is None
    assert of_copies.competence[1:] == table.competence[3:6]  # scripted policies are played again


def test_text_and_csv_hold_every_seed_and_real_counts(table: Table2) -> None:
    text = table2_markdown(table)
    lines = list(csv.DictReader(io.StringIO(table2_csv(table))))
    assert len(lines) == 2 * (2 * (3 + 1) + 2 * (2 + 1) + 2 * (1 + 1))
    (episodes,) = {row.recorded.episodes for row in table.rows}
    for line in lines:
        assert int(line["rescues_0"]) + int(line["rescues_1"]) > 0
        assert f"{line['rescues_0']} + {line['rescues_1']}" in text
        assert (line["score"] == "") == (int(line["episodes"]) == episodes)
        if line["share_low_90"]:
            assert float(line["share_low"]) < float(line["share_low_90"])
            assert float(line["share_high_90"]) < float(line["share_high"])
            ends = (float(line[f"share_{end}_90"]) for end in ("low", "high"))
            assert "[{}, {}]".format(*map(format_number, ends)) in text
    for block in text.split("\n\n"):
        widths = {line.count("|") for line in block.splitlines() if line.startswith("|")}
        assert len(widths) <= 1
    document = json.dumps(table.to_json(), allow_nan=False)
    assert json.loads(document)["schema_version"] == 1


def test_cells_of_text() -> None:
    assert markdown_table(["a"], [["|x|"]]) == "| a |\n| --- |\n| \\|x\\| |\n"
    assert [format_number(-0.004), format_number(-0.006), format_number(0.125, 1)] == [
        "0.00",
        "-0.01",
        "0.1",
    ]


def test_runs_that_are_not_one_study_are_refused(runs: list[StudyRun]) -> None:
    with pytest.raises(RunError, match="at least one run"):
        by_method([])
    with pytest.raises(RunError, match="both are mixed, td-inner, seed 0"):
        by_method([*runs, runs[1]])
    assert [config.train.seed for config in read_configs(runs[:3])] == [2, 0, 1]
    with pytest.raises(RunError, match=r"train\.seed = 2, but it is listed as 5"):
        read_configs([replace(runs[0], seed=5)])
    other = changed(runs[5])
    with pytest.raises(RunError, match="listed as the same but for the seed, and differ in ppo"):
        read_configs([runs[5], other])


def changed(run: StudyRun) -> StudyRun:
    """The same run, trained with another clip."""
    folder = run.folder.with_name("changed")
    folder.mkdir()
    text = (run.folder / "config.toml").read_text()
    (folder / "config.toml").write_text(text.replace("\nclip = 0.2", "\nclip = 0.3"))
    return replace(run, folder=folder)


def test_a_run_without_an_evaluation_is_refused(runs: list[StudyRun]) -> None:
    with pytest.raises(RunError, match=r"summary.json: no finished evaluation"):
        read_measured(replace(runs[0], folder=runs[0].folder / "checkpoints"))
    with pytest.raises(RunError, match="holds no episodes of ppo-inner"):
        read_measured(replace(runs[0], method="ppo-inner"))
