"""`innerattn evaluate`: the document, the tables, and what is refused."""

import json
import math
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from innerattn.cli.main import main

FEW = ["--episodes", "4", "--score-episodes", "6", "--long-episodes", "2"]


def document(capsys: pytest.CaptureFixture[str], *options: str) -> dict[str, Any]:
    """What ``--json -`` prints: the document and nothing else."""
    assert main(["evaluate", *options, "--json", "-"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert isinstance(found, dict)
    return found


def check_interval(value: dict[str, float]) -> None:
    assert value.keys() == {"mean", "low", "high"}
    assert value["low"] <= value["mean"] <= value["high"]


@pytest.mark.parametrize("policy", ["random", "greedy", "hungarian"])
def test_scripted_policies(policy: str, capsys: pytest.CaptureFixture[str]) -> None:
    found = document(capsys, policy, *FEW, "--situation", "double", "--seed", "5")
    assert found["schema_version"] == 1
    assert found["policy"] == found["method"] == policy
    assert (found["situation"], found["seed"]) == ("double", 5)
    assert (found["episodes"], found["episode_steps"]) == (4, 25)
    check_interval(found["rescues_per_episode"])
    check_interval(found["score"])
    assert found["cooperation"].keys() == {"task_1", "task_2"}
    assert all(robots.keys() == {"food_0", "food_1"} for robots in found["cooperation"].values())
    assert found["attention_entropy"] == {}


def test_scripted_policies_frame_the_score(capsys: pytest.CaptureFixture[str]) -> None:
    assert document(capsys, "random", *FEW)["score"]["mean"] == 0.0
    assert document(capsys, "hungarian", *FEW)["score"]["mean"] == 1.0


def test_a_run_is_measured_as_after_training(
    run_dir: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    found = document(capsys, str(run_dir))
    assert found == json.loads((run_dir / "evaluation" / "summary.json").read_text())
    assert (found["policy"], found["method"]) == (run_dir.name, "td-inner")
    assert list(found["attention_entropy"]) == ["food_0", "food_1", "navigation_0", "medical_0"]
    for heads in found["attention_entropy"].values():
        assert len(heads) == 2
        assert all(0.0 <= nats <= math.log(3) + 1e-6 for nats in heads)


def test_options_win_over_the_run(run_dir: Path, capsys: pytest.CaptureFixture[str]) -> None:
    options = ["--episodes", "3", "--score-episodes", "3", "--episode-steps", "10", "--seed", "1"]
    found = document(capsys, str(run_dir), *options, "--situation", "double")
    assert (found["episodes"], found["score_episodes"]) == (3, 3)
    assert (found["episode_steps"], found["seed"]) == (10, 1)
    assert found["situation"] == "double"
    assert found["long"]["episodes"] == 2


def test_a_script_in_a_world_of_ones_own(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "mine.toml"
    path.write_text('situation = "single"\nepisode_steps = 7\nrescue_radius_m = 0.5\n')
    found = document(capsys, "greedy", *FEW, "--scenario", str(path))
    assert (found["situation"], found["episode_steps"]) == ("single", 7)
    assert document(capsys, "greedy", *FEW)["situation"] == "mixed"


LISTED = """situation = "listed"
episode_steps = 20
end_when_done = true
arrivals = [{ at_s = 0.0, task = "task_1", position_m = [0.5, 0.5] }]
"""
POISSON = """situation = "poisson"
tasks = [{ name = "one", needs = ["food"], arrival_rate_hz = 0.5 }]
"""


@pytest.mark.parametrize(("situation", "text"), [("listed", LISTED), ("poisson", POISSON)])
def test_victims_that_arrive_are_taken_where_the_scenario_has_some(
    situation: str, text: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(text)
    found = document(capsys, "greedy", *FEW, "--scenario", str(path), "--situation", situation)
    assert found["situation"] == situation
    assert found["rescues_per_episode"]["mean"] > 0.0
    assert found == document(capsys, "greedy", *FEW, "--scenario", str(path))


@pytest.mark.parametrize(
    ("situation", "text", "message"),
    [
        ("poisson", "", "--situation poisson: no task of the scenario has an arrival_rate_hz"),
        ("listed", "", "--situation listed: the scenario has no arrivals, so nobody would arrive"),
        ("listed", "situation = 'listed'", "--situation listed: the scenario has no arrivals"),
        ("mixed", POISSON, "tasks[0].arrival_rate_hz = 0.5: must be 0 but where situation ="),
        ("listed", POISSON, "tasks[0].arrival_rate_hz = 0.5: must be 0 but where situation ="),
        ("poisson", LISTED, "scenario.arrivals (their number) = 1: must be 0 but where"),
        ("single", LISTED, "scenario.arrivals (their number) = 1: must be 0 but where"),
    ],
)
def test_situations_in_which_a_scenario_cannot_be_played(
    situation: str, text: str, message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(text)
    where = ["--scenario", str(path)] if text else []
    assert main(["evaluate", "greedy", *FEW, *where, "--situation", situation]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert message in err
    assert err.count("\n") == 1


def test_tables_and_file(run_dir: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "out.json"
    assert main(["evaluate", str(run_dir), "--json", str(file)]) == 0
    printed = capsys.readouterr().out
    written = json.loads(file.read_text())
    assert f"{written['scripted']['greedy']['mean']:.2f} ± " in printed
    assert "td-inner (trained)" in printed
    assert "task_1 (food + medicine)" in printed
    assert max(map(len, printed.splitlines())) <= 80


def test_a_run_without_attention_shows_none(
    tmp_path: Path, tiny: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    run = str(tmp_path / "plain")
    assert main(["train", "--method", "mappo", "--run-dir", run, *tiny]) == 0
    assert main(["evaluate", run]) == 0
    for printed in capsys.readouterr().out.split("Measure it again"):
        assert "mappo (trained)" in printed
        assert "Attention entropy" not in printed
    assert document(capsys, run)["attention_entropy"] == {}


def test_wrong_values(run_dir: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "empty").mkdir()
    shutil.copytree(run_dir, tmp_path / "without", ignore=shutil.ignore_patterns("checkpoints"))
    cases = [
        (1, ["nobody"], "nobody: neither a run's folder nor one of random, greedy, hungarian"),
        (1, [str(tmp_path / "empty")], f"{tmp_path / 'empty' / 'run.json'}: missing"),
        (1, [str(tmp_path / "without")], f"{tmp_path / 'without'}: holds no checkpoint yet"),
        (1, ["random", "--json", str(tmp_path)], f"{tmp_path}: is a folder; must be a file"),
        (2, ["random", "--episodes", "0"], "evaluate.episodes = 0: must be greater"),
        (2, ["random", "--episode-steps", "0"], "scenario.episode_steps = 0: must be"),
        (1, [str(run_dir), "--situation", "single"], f"{run_dir}: was trained for other"),
        (
            1,
            ["random", *FEW, "--json", str(tmp_path / "no" / "x.json")],
            f"{tmp_path / 'no'}: no such folder",
        ),
    ]
    for code, options, message in cases:
        assert main(["evaluate", *options]) == code
        err = capsys.readouterr().err
        assert err.startswith(f"innerattn: error: {message}")
        assert err.count("\n") == 1


def test_a_scenario_is_checked_as_it_is_measured(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "late.toml"
    path.write_text(
        'faults = [{robot = "food_0", kind = "blackout", value = 1.0, onset_step = 50}]\n'
    )
    options = ["evaluate", "random", "--scenario", str(path), *FEW]
    assert main(options) == 1  # an episode has 25 steps
    assert "onset_step = 50" in capsys.readouterr().err
    longer = ["--episode-steps", "60", "--long-episode-steps", "80"]
    assert main([*options, *longer, "--json", "-"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert (document["episode_steps"], document["long"]["episode_steps"]) == (60, 80)


@pytest.mark.long
def test_output_that_cannot_be_written_as_it_is_is_written_anyhow() -> None:
    found = subprocess.run(
        [sys.executable, "-m", "innerattn", "evaluate", "greedy", *FEW],
        env={**os.environ, "PYTHONIOENCODING": "ascii"},
        capture_output=True,
        check=True,
    )
    assert b" ? " in found.stdout  # the sign between a mean and its half interval
