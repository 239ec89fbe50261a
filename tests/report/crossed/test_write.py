"""The files of the crossed design: the same twice, every run named, no number lost."""

import csv
import json
import shutil
from dataclasses import replace
from pathlib import Path

import pytest
from markdown_rows import rows_of

from innerattn.experiments.crossed.arms import arm_of
from innerattn.experiments.crossed.outcome import outcome_of
from innerattn.experiments.crossed.study import Situation
from innerattn.experiments.run import FinishedRun
from innerattn.report.crossed.tables import claims_table
from innerattn.report.crossed.write import FILES, write
from innerattn.report.table import markdown
from innerattn.stats.text import format_estimate
from innerattn.train.weights import digest_of

Crossed = tuple[Path, list[FinishedRun]]
Short = tuple[Path, Situation]


@pytest.fixture(scope="module")
def short(crossed: Crossed, tmp_path_factory: pytest.TempPathFactory) -> Short:
    """The files of budget short, and what they say; not to be changed."""
    out, runs = crossed
    (situation,) = write(runs, out, "short")
    kept = tmp_path_factory.mktemp("short")
    for name in FILES:
        shutil.copy(out / name, kept)
    return kept, situation


@pytest.mark.long
def test_files_are_the_same_twice_and_say_what_they_are_of(crossed: Crossed) -> None:
    out, runs = crossed
    write(runs, out, "quick", ["mixed td-inner seed 9: failed"])
    before = {name: (out / name).read_bytes() for name in FILES}
    write(runs[::-1], out, "quick", ["mixed td-inner seed 9: failed"])
    assert {name: (out / name).read_bytes() for name in FILES} == before
    text = before["crossed.md"].decode()
    assert text.index("smoke run") < text.index("mixed td-inner seed 9: failed")
    assert "smoke run" in json.loads(before["crossed.json"])["note"]
    write(runs, out, "short")
    for name in FILES:
        assert (out / name).read_bytes() != before[name], name
    text = (out / "crossed.md").read_text()
    assert "smoke" not in text
    assert "Left out" not in text


@pytest.mark.long
def test_every_run_has_a_line(crossed: Crossed) -> None:
    out, runs = crossed
    write(runs, out, "quick")
    document = json.loads((out / "crossed.json").read_text())
    (situation,) = document["situations"]
    assert len(situation["runs"]) == len(runs) == 18
    rows = list(csv.DictReader((out / "crossed.csv").read_text().splitlines()))
    assert {row["note"] for row in rows} == {document["note"]}
    by_folder = {f"runs/{run.folder.name}": run.case for run in runs}
    scores = set()
    for row, of_json in zip(rows, situation["runs"], strict=True):
        assert row["folder"] == of_json["folder"]
        case = by_folder[row["folder"]]
        arm = arm_of(case)
        (own,) = [run for run in runs if run.folder == out / of_json["folder"]]
        expected = outcome_of(own)
        penalty = "" if arm.penalty is None else str(arm.penalty)
        assert (row["method"], row["credit"], row["penalty"]) == (arm.method, arm.credit, penalty)
        assert (row["seed"], row["shared"]) == (str(case.seed), str(arm.shared))
        for name, value in vars(expected).items():
            assert float(row[name]) == of_json[name] == value
        weights = own.folder / "checkpoints" / "0" / "weights.safetensors"
        assert row["weights_sha256"] == of_json["weights_sha256"] == digest_of(weights)
        scores.add((expected.score, expected.entropy_share))
    assert len(scores) == 18  # else runs could be taken for one another


@pytest.mark.long
def test_the_page_opens_with_its_figure_and_links_the_rest(short: Short) -> None:
    out, situation = short
    text = (out / "crossed.md").read_text()
    opening = text.split("\n## ")[0]
    assert opening.splitlines()[2].endswith("(crossed_seeds.png)")
    assert "18 runs, budget `short`, seeds 0, 1." in opening
    linked = {name for name in FILES if f"({name})" in text}
    assert linked == {"crossed.png", "crossed_seeds.png", "crossed.csv", "crossed_tables.md"}
    claims = {row[0]: row[1:] for row in rows_of(text)}
    for answer in situation.answers:
        assert claims[answer.claim] == [situation.name, answer.measured, f"**{answer.holds}**"]
    assert len(text.split()) < 2_500


@pytest.mark.long
def test_verdicts_of_situations_stand_below_one_another(short: Short) -> None:
    _, mixed = short
    rows = rows_of(markdown(claims_table([mixed, replace(mixed, name="double")])))[1:]
    assert [row[0] for row in rows[::2]] == [answer.claim for answer in mixed.answers]
    assert {row[0] for row in rows[1::2]} == {""}
    assert [row[1] for row in rows] == ["mixed", "double"] * len(mixed.answers)
    assert [row[2:] for row in rows[::2]] == [row[2:] for row in rows[1::2]]


@pytest.mark.long
def test_the_long_tables_hold_every_arm_and_effect(short: Short) -> None:
    out, situation = short
    rows = rows_of((out / "crossed_tables.md").read_text())
    by_arm = {row[0]: row for row in rows if len(row) == 8}
    for arm, means in situation.means.items():
        assert by_arm[str(arm)][1] == "2"
        assert by_arm[str(arm)][5] == format_estimate(means["score"])
    listed = [row for row in rows if len(row) == 9]
    assert len(listed) - 1 == len(situation.effects)
