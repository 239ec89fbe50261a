"""Rows of Table II against hand counts, printed rows, text and CSV."""

import csv
import io
import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from innerattn.errors import RunError
from innerattn.experiments.archive import read_archive, write_archive
from innerattn.experiments.paper.table2 import Table2, table2
from innerattn.experiments.run import FinishedRun, by_method, read_run, refuse_unlike
from innerattn.measures.dispatch_quality import dispatch_quality
from innerattn.measures.waiting import waiting
from innerattn.records.parquet import read_records
from innerattn.report.paper.table2 import table2_csv, table2_markdown
from innerattn.stats.estimate import as_json
from innerattn.stats.student import student_interval
from innerattn.stats.text import format_number


@pytest.fixture(scope="module")
def groups(runs: list[FinishedRun]) -> list[list[FinishedRun]]:
    return list(by_method(runs).values())


@pytest.fixture(scope="module")
def table(groups: list[list[FinishedRun]]) -> Table2:
    return table2(groups)


def counted(measured: FinishedRun, task: int, episodes: int) -> tuple[int, int]:
    """Rescues of a task by food_0 and food_1 in the first episodes, by plain loops."""
    records = read_records(measured.folder / "evaluation")
    first, second = 0, 0
    for record in [r for r in records if r.policy == measured.method][:2]:
        for event in record.rescues:
            if event["episode"] < episodes and event["task"] == task:
                helpers = {int(event["helper_0"]), int(event["helper_1"])}
                first += 0 in helpers
                second += 1 in helpers
    return first, second


def test_rows_against_hand_counts(groups: list[list[FinishedRun]], table: Table2) -> None:
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


def test_competence_is_that_of_the_same_runs(
    groups: list[list[FinishedRun]], table: Table2
) -> None:
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
def test_scripted_policies_stand_beside_the_runs_as_their_evaluations_found(
    name: str, groups: list[list[FinishedRun]], table: Table2
) -> None:
    (part,) = [c for c in table.competence if (c.situation, c.method) == ("mixed", name)]
    assert part.seeds == (0, 1, 2)
    for measured, figures, counts in zip(groups[0], part.each, part.counts, strict=True):
        of_all = read_records(measured.folder / "evaluation")
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
    assert text.count(f"| **{name}** | mean [95 %] |") == 1
    assert text.count(f"| {name} | 0 |") == 1  # of the single run in single


def test_archived_runs_are_enough_for_sharing_and_scores(
    runs: list[FinishedRun], table: Table2, tmp_path: Path
) -> None:
    write_archive(runs[:3], tmp_path / "archive.parquet")
    archived = read_archive(tmp_path / "archive.parquet")
    of_copies = table2(list(by_method(archived).values()))
    assert as_json(of_copies.rows) == as_json(table.rows[:2])
    for whole, copy in zip(table.competence[0].each, of_copies.competence[0].each, strict=True):
        assert copy == whole
    assert of_copies.competence[1:] == table.competence[3:6]  # scripted policies


def test_evaluations_without_measures_leave_them_out(groups: list[list[FinishedRun]]) -> None:
    older = []
    for run in groups[0]:
        summary = {name: value for name, value in run.summary.items() if name != "measures"}
        records = [replace(record, steps={}) for record in run.scored]
        older.append(replace(run, summary=summary, read=lambda records=records: records))
    (part,) = table2([older]).competence
    for run, values in zip(older, part.each, strict=True):
        assert values["rescues_per_episode"] == run.summary["rescues_per_episode"]["mean"]
        assert values["sooner"] is values["regret_s"] is values["time_to_rescue_s"] is None


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
    assert [format_number(-0.004), format_number(-0.006), format_number(0.125, 1)] == [
        "0.00",
        "-0.01",
        "0.1",
    ]


def test_runs_that_are_not_one_study_are_refused(runs: list[FinishedRun]) -> None:
    with pytest.raises(RunError, match="at least one run"):
        by_method([])
    with pytest.raises(RunError, match="both are mixed, td-inner, seed 0"):
        by_method([*runs, runs[1]])
    refuse_unlike(runs)
    with pytest.raises(RunError, match=r"train\.seed = 2, but it is listed as 5"):
        refuse_unlike([replace(runs[0], case=replace(runs[0].case, seed=5))])
    ppo = runs[5].config.ppo.model_copy(update={"clip": 0.3})
    other = replace(runs[5], config=runs[5].config.model_copy(update={"ppo": ppo}))
    with pytest.raises(RunError, match="listed as the same but for the seed, and differ in ppo"):
        refuse_unlike([runs[5], other])


def test_a_run_without_an_evaluation_is_refused(runs: list[FinishedRun], tmp_path: Path) -> None:
    folder = Path(shutil.copytree(runs[0].folder, tmp_path / "run"))
    with pytest.raises(RunError, match="holds no episodes of ppo-inner"):
        _ = replace(runs[0], case=replace(runs[0].case, method="ppo-inner")).scored
    (folder / "evaluation" / "summary.json").unlink()
    with pytest.raises(RunError, match=r"summary\.json: missing"):
        read_run(runs[0].case, folder)
