"""`innerattn robustness`: the document, the tables, the picture, and what is refused."""

import json
import re
import shutil
from pathlib import Path

import pytest
import tomli_w

from innerattn.cli.main import main

FEW = ["--episodes", "4", "--episode-steps", "26", "--faults", "motor_gain, lost_communication"]


@pytest.mark.long
def test_the_document_alone_on_standard_output_and_a_page_about_the_run(
    run_dir: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    page = tmp_path / "page.html"
    options = [str(run_dir), *FEW, "--report", str(page), "--json", "-"]
    assert main(["robustness", *options]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["schema_version"] == 1
    names = [policy["policy"] for policy in found["policies"]]
    assert names == [run_dir.name, "greedy", "hungarian", "oracle"]
    assert found["policies"][0]["method"] == "td-inner"
    assert (found["episodes"], found["episode_steps"]) == (4, 26)
    by_kind = found["policies"][0]["by_kind"]
    assert by_kind.keys() == {"motor_gain", "lost_communication", "all"}
    assert found["bounds"][run_dir.name]["violations"] == 0
    kinds = found["attention"][run_dir.name]["kinds"]
    assert [kind["kind"] for kind in kinds] == ["motor_gain", "lost_communication"]
    text, both = page.read_text("utf-8"), by_kind["all"]
    assert "Retention under faults" in text
    if both is not None:
        assert f"{both['mean']:.2f} [{both['low']:.2f}, {both['high']:.2f}]" in text
    twice = tmp_path / "copy"
    shutil.copytree(run_dir, twice)
    assert main(["robustness", str(run_dir), str(twice), "--report", str(page)]) == 1
    assert "must be one run of each seed" in capsys.readouterr().err


@pytest.mark.long
def test_tables_a_file_and_a_picture(
    run_dir: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    other = tmp_path / run_dir.parent.name / run_dir.name  # alike to the last but one part
    shutil.copytree(run_dir, other)
    before = {path: path.stat().st_mtime_ns for path in run_dir.rglob("*")}
    files = {"--json": tmp_path / "found.json", "--plot": tmp_path / "found.png"}
    options = [word for option, path in files.items() for word in (option, str(path))]
    assert main(["robustness", str(run_dir), str(other), *FEW, "--seed", "1", *options]) == 0
    shown = capsys.readouterr().out
    for words in (
        *("motor gain", "lost communication", "all kinds", "oracle", "0 violations", "AUC"),
        *("rescues, no fault", "rescues, fault"),
    ):
        assert words in shown
    assert [line for line in shown.splitlines() if len(line.rstrip()) > 80] == []
    verdict, names_of_runs = shown.strip().split("\n\n")[:2]
    words = " ".join(verdict.split())
    assert re.match(r"(With the worst .+ A keeps .+\.|A rescues nobody, .+\.) ", words)
    assert re.search(r" Share of rescues kept when a robot fails: A .+, B .+, hungarian ", words)
    assert " Fault that costs most: " in words
    first, second = names_of_runs.splitlines()
    document = json.loads(files["--json"].read_text())
    assert document["seed"] == 1
    ends = [f"{path.parts[-3]}/{path.parts[-2]}/{path.name}" for path in (run_dir, other)]
    names = [policy["policy"] for policy in document["policies"]]
    assert names == [*ends, "greedy", "hungarian", "oracle"]
    assert list(document["bounds"]) == list(document["attention"]) == ends
    assert [first, second] == [f"A: {ends[0]}", f"B: {ends[1]}"]
    assert "A: a fault from the start" in shown
    assert "B: bounds on attention" in shown
    assert files["--plot"].read_bytes().startswith(b"\x89PNG")
    assert {path: path.stat().st_mtime_ns for path in run_dir.rglob("*")} == before


@pytest.mark.parametrize(
    ("options", "code", "message"),
    [
        (["--report", "x.pdf"], 2, "--report x.pdf: must end in .html"),
        (["--faults", "rust"], 2, "--faults = 'rust': known are all, motor_gain"),
        (["--episodes", "1"], 2, "--episodes = 1: must be 2 to 1,000,000"),
        (["--episode-steps", "1"], 2, "--episode-steps = 1: must be 2 to 1,000,000"),
        (["--plot", "map.jpeg"], 2, "--plot map.jpeg: must end in one of .pdf, .png, .svg"),
        (["--json", "nowhere/a.json"], 1, "nowhere: no such folder"),
        (["--json", "/tmp"], 1, "/tmp: is a folder; must be a file"),
        (["--json", "/dev/null"], 1, "/dev/null: is no plain file, and would be replaced"),
        (["--seed", str(2**63)], 2, f"--seed {2**63}: must be 0 to 2**63 - 1"),
    ],
)
def test_refusals_are_one_line(
    run_dir: Path,
    options: list[str],
    code: int,
    message: str,
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(["robustness", str(run_dir), *FEW, *options]) == code
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1
    assert message in captured.err


def test_a_run_is_measured_once(run_dir: Path, capsys: pytest.CaptureFixture[str]) -> None:
    again = run_dir / ".." / run_dir.name
    assert main(["robustness", str(run_dir), str(again), *FEW]) == 2
    assert f"RUN = {again}: is given twice" in capsys.readouterr().err


def test_a_run_that_is_not_there_is_named(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["robustness", "no-such-run", *FEW]) == 1
    assert "no-such-run" in capsys.readouterr().err


@pytest.mark.long
@pytest.mark.parametrize(
    ("robots", "left_out"), [(1, "its bounds included"), (2, "where attention")]
)
def test_small_teams_have_no_attention_to_look_at(
    robots: int,
    left_out: str,
    tiny: list[str],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    names = ("food_0", "food_1")[:robots]
    team = [{"name": name, "kind": "food", "abilities": ["food"]} for name in names]
    driven = [{**robot, "max_speed_mps": 1.0, "mass_kg": 1.0} for robot in team]
    world = {"robots": driven, "tasks": [{"name": "task_1", "needs": ["food"]}]}
    (tmp_path / "few.toml").write_text(tomli_w.dumps({"scenario": world}))
    run = tmp_path / "run"
    assert (
        main(["train", "--config", str(tmp_path / "few.toml"), "--run-dir", str(run), *tiny]) == 0
    )
    capsys.readouterr()
    assert main(["robustness", str(run), *FEW, "--json", "-"]) == 0
    out, err = capsys.readouterr()
    found = json.loads(out)
    assert len(found["bounds"]) == robots - 1
    assert found["attention"] == {}
    assert err.startswith("innerattn: left out: ")
    assert left_out in err
