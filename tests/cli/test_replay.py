"""`innerattn replay`: what it writes for runs, scripts and files, and what it refuses."""

import json
import re
import shutil
from pathlib import Path
from typing import Any

import pytest

from innerattn.cli.main import main
from innerattn.records import read_records


def replayed(out: Path, *options: str) -> dict[str, Any]:
    """The document in the page that the command writes."""
    assert main(["replay", *options, "-o", str(out)]) == 0
    page = out.read_text("utf-8")
    (found,) = re.findall(r'<script type="application/json" id="data">(.*?)</script>', page)
    document = json.loads(found)
    assert isinstance(document, dict)
    return document


def test_a_run_beside_a_script_in_the_same_worlds(
    run_dir: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = sorted(path.stat().st_mtime_ns for path in run_dir.rglob("*"))
    found = replayed(tmp_path / "r.html", str(run_dir), "hungarian")
    assert [run["name"] for run in found["runs"]] == [run_dir.name, "hungarian"]
    record = read_records(run_dir / "evaluation")[0]
    assert found["worlds"]["seed"] == str(record.seed)
    assert found["worlds"]["episodes"] == record.num_episodes == 4
    assert "attention" in found["runs"][0]
    assert "attention" not in found["runs"][1]
    assert re.fullmatch(r"\S+r\.html: 4 episodes, 0\.\d MB\n", capsys.readouterr().out)
    assert sorted(path.stat().st_mtime_ns for path in run_dir.rglob("*")) == before


def test_a_file_shows_what_its_run_shows(run_dir: Path, tmp_path: Path) -> None:
    copy = tmp_path / "copied" / "evaluation"
    shutil.copytree(run_dir / "evaluation", copy)
    of_run = replayed(tmp_path / "a.html", str(run_dir))
    for name in (copy / "episodes.parquet", copy):
        of_file = replayed(tmp_path / "b.html", str(name))
        assert of_file["data"] == of_run["data"]
        assert of_file["runs"][0]["name"] == "copied"


def test_what_is_asked_for_is_played(run_dir: Path, tmp_path: Path) -> None:
    scenario = tmp_path / "mine.toml"
    scenario.write_text('situation = "single"\nmax_victims = 2\nepisode_steps = 7\n')
    found = replayed(tmp_path / "r.html", "greedy", "--scenario", str(scenario), "--seed", "3")
    assert (found["worlds"]["seed"], found["worlds"]["situation"]) == ("3", "single")
    assert found["runs"][0]["positions"]["shape"] == [20, 7, 4, 2]
    found = replayed(tmp_path / "r.html", str(run_dir), "oracle", "--episodes", "2")
    assert found["worlds"]["episodes"] == 2
    assert found["runs"][0]["attention"]["shape"][:3] == [2, 25, 2]


def test_a_run_without_attention(tmp_path: Path, tiny: list[str]) -> None:
    run = str(tmp_path / "plain")
    assert main(["train", "--method", "mappo", "--run-dir", run, *tiny]) == 0
    assert "attention" not in replayed(tmp_path / "r.html", run)["runs"][0]


@pytest.mark.long
def test_a_moving_picture(run_dir: Path, tmp_path: Path) -> None:
    out = tmp_path / "r.gif"
    assert main(["replay", str(run_dir), "-o", str(out), "--episode", "1"]) == 0
    assert out.read_bytes()[:6] == b"GIF89a"


def test_wrong_use(run_dir: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bare = tmp_path / "bare"
    shutil.copytree(run_dir, bare, ignore=shutil.ignore_patterns("evaluation"))
    (tmp_path / "x.parquet").write_text("no")
    file = str(run_dir / "evaluation" / "episodes.parquet")
    cases = [
        (1, ["nobody"], "nobody: neither a run's folder nor one of random, greedy, hungarian, p"),
        (2, [], "0 policies: must be 1 to 4 of RUN|POLICY|FILE"),
        (2, ["greedy"] * 5, "5 policies: must be 1 to 4"),
        (1, [str(bare)], f"{bare}: holds no recorded episodes"),
        (1, [str(tmp_path / "x.parquet")], "must be named episodes.parquet"),
        (2, [file, "--episodes", "3"], f"{file}: holds records, which cannot play"),
        (2, ["greedy", "--episodes", "0"], "--episodes 0: must be 1 to 1000"),
        (2, ["greedy", "-o", "x.png"], "-o x.png: must end in one of .html, .gif, .mp4"),
        (2, ["greedy", "--episode", "3"], "--episode, --robot, --attention: are for .gif and"),
        (2, ["greedy", "-o", "x.gif", "--moments", "m.toml"], "--moments: needs a page, not x.g"),
        (1, ["greedy", "--moments", str(tmp_path / "m.toml")], "cannot read"),
        (1, ["greedy", "-o", str(tmp_path / "no" / "x.html")], f"{tmp_path / 'no'}: no such f"),
        (1, ["greedy", "-o", str(tmp_path / "x.gif"), "--episode", "30"], "must be 0 to 19"),
        (2, ["greedy", "--seed", "-1"], "--seed -1: must be 0 to 2**63 - 1"),
    ]
    for code, options, message in cases:
        out = [] if "-o" in options else ["-o", str(tmp_path / "out.html")]
        assert main(["replay", *options, *out]) == code, options
        captured = capsys.readouterr()
        assert message in captured.err
        assert captured.err.count("\n") == 1
    assert not (tmp_path / "out.html").exists()
