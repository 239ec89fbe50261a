"""Every message that the page explains is one that the program gives, word for word."""

import builtins
import re
import shutil
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

from innerattn.cli.main import main
from innerattn.cli.start import main as start
from innerattn.errors import InnerattnError, UnsealedRunWarning
from innerattn.policies import Exported
from innerattn.records.run_folder import newest_weights

PAGE = (Path(__file__).parents[2] / "docs" / "faq.md").read_text("utf-8")
QUOTED = re.findall(r"(?m)^\*\*`(.+?)`\*\* —", PAGE)


def scenario(text: str) -> list[str]:
    Path("mine.toml").write_text(text)
    return ["info", "--scenario", "mine.toml"]


def two_runs() -> list[str]:
    for name in ("mixed-a", "mixed-b"):
        folder = Path("runs") / name
        folder.mkdir(parents=True)
        (folder / "run.json").write_text("{}")
    return ["evaluate", "mixed"]


TEAM = """
[[robots]]
name = "a"
kind = "a"
abilities = ["water"]
max_speed_mps = 1.0
mass_kg = 1.0
"""
STALE = "own.time: is 0.500 s before now: must be at most 0.3 s away"
UNKNOWN = "own.heading: is unknown; known are available, faults, position, time, velocity"
SHORT = "row: has dtype float64 and shape (3,): must hold 44 numbers"
TORCH = "needs torch: pip install 'innerattn[train]'"
ALTERED = "is not the file that manifest.json names; it was altered"
CALLS: dict[str, Callable[[], list[str]]] = {
    "--sede: unknown option, did you mean --seed?": lambda: ["train", "--sede", "1"],
    "trian: unknown command, did you mean train?": lambda: ["trian"],
    "td.gamma = 2.0: must be less than or equal to 1": lambda: ["train", "--td.gamma", "2"],
    "train.device = 'gpu': not usable here": lambda: ["train", "--device", "gpu"],
    "exists already; choose another run folder or remove it": lambda: [
        *("train", "--run-dir", "."),
    ],
    "scenario.situaton: unknown key, did you mean situation?": lambda: scenario(
        'situaton = "double"\n'
    ),
    "task 'x' needs 'water', which no robot of the team can do": lambda: scenario(
        '[[tasks]]\nname = "x"\nneeds = ["water"]\n'
    ),
    "scenario.tasks[0].needs = water + water: the team has no distinct able robot for each need": (
        lambda: scenario(TEAM + '[[tasks]]\nname = "x"\nneeds = ["water", "water"]\n')
    ),
    "cannot read mine.toml: No such file or directory": lambda: [
        *("evaluate", "hungarian", "--scenario", "mine.toml"),
    ],
    "train.method = 'td-inner' learns 'discrete' actions only": lambda: [
        *("train", "--method", "td-inner", "--scenario.actions", "continuous"),
    ],
    "neither a run's folder nor one of random, greedy, hungarian": lambda: [
        "evaluate",
        "none",
    ],
    "latest: no run is in runs yet": lambda: ["evaluate", "latest"],
    "2 runs in runs begin so": two_runs,
    "a team of the package is done, nothing to go on from": lambda: [
        *("train", "--resume", "zoo:mixed"),
    ],
    "a team of the package has no metrics for a report": lambda: ["report", "zoo:mixed"],
    "-o FOLDER must say where to write": lambda: ["export", "zoo:mixed"],
}


@pytest.mark.parametrize("message", CALLS)
def test_commands(
    message: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert message in QUOTED
    with suppress(SystemExit):  # wrong words
        assert main(CALLS[message]()) in (1, 2)
    err = capsys.readouterr().err
    assert message in err
    assert len(err.splitlines()) == 1


def test_a_changed_file_of_a_run(run_dir: Path, tmp_path: Path) -> None:
    run = tmp_path / "run"
    shutil.copytree(run_dir, run)
    weights = next(run.rglob("weights.safetensors"))
    weights.write_bytes(weights.read_bytes()[:-1] + b"\x01")
    with pytest.raises(InnerattnError) as caught:
        load(run)
    assert one_of_the_page(str(caught.value)) == ALTERED


def test_a_run_without_a_manifest(run_dir: Path, tmp_path: Path) -> None:
    run = tmp_path / "run"
    shutil.copytree(run_dir, run)
    (run / "manifest.json").unlink()
    info = run / "run.json"
    info.write_text(info.read_text().replace('"sealed": true', '"sealed": false'))
    with pytest.warns(UnsealedRunWarning) as warned:
        load(run)
    assert one_of_the_page(str(warned[0].message)) == "has no manifest.json"


def test_readings_and_files_of_robots(plain_team: Path, tmp_path: Path) -> None:
    one = shutil.copytree(plain_team / "export", tmp_path / "export")
    body = {"position": (0.0, 0.0), "velocity": (0.0, 0.0)}
    bad = {"position": (float("nan"), 0.0), "velocity": (0.0, 0.0)}
    team = Exported(one, backend="numpy")
    names = team.robot_names[1:]
    readings = {"own": body, "teammates": dict.fromkeys(names, body), "victims": []}
    readings["teammates"] = {**readings["teammates"], "food_1": bad}  # type: ignore[dict-item]
    assert refusal(team, readings).startswith("teammates.food_1.position")
    timed = {**readings, "teammates": {}, "own": {**body, "time": 1.0}, "victims_time": 1.0}
    assert refusal(team, {**timed, "now": 1.5}) == STALE
    assert refusal(team, {**timed, "own": {**body, "heading": 0.0}}) == UNKNOWN
    assert refusal(team, [0.0, 0.0, 0.0]) == SHORT
    shutil.copy(newest_weights(plain_team / "run"), one / "weights.safetensors")
    with pytest.raises(InnerattnError) as caught:
        Exported(one, backend="numpy")
    assert one_of_the_page(str(caught.value)) == "is of another team"


def refusal(team: Exported, readings: object) -> str:
    """The message of the page with which a team refuses readings."""
    with pytest.raises(InnerattnError) as caught:
        team.decide("food_0", readings)  # type: ignore[arg-type]
    return one_of_the_page(str(caught.value))


def test_a_library_that_is_not_installed(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    missing = ModuleNotFoundError("No module named 'torch'", name="torch")
    monkeypatch.setattr(builtins, "__import__", failing(missing, "innerattn.cli.main"))
    assert start(["info"]) == 1
    assert one_of_the_page(capsys.readouterr().err) == TORCH


def failing(error: Exception, module: str) -> Callable[..., object]:
    """An import that fails for one module."""
    real = builtins.__import__

    def imported(name: str, *rest: Any) -> object:
        if name == module:
            raise error
        return real(name, *rest)

    return imported


def test_a_training_too_short_to_learn(
    tmp_path: Path, tiny: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    few = ["--td.warmup-env-steps", "1000000", "--run-dir", str(tmp_path / "few")]
    assert main(["train", *tiny, *few]) == 0
    assert "too few for one update; nothing was learnt from rewards" in QUOTED
    assert "too few for one update; nothing was learnt from rewards" in capsys.readouterr().err


def test_every_message_of_the_page_was_tried() -> None:
    elsewhere = {
        ALTERED,
        "has no manifest.json",
        "teammates.food_1.position",
        "is of another team",
        *(STALE, UNKNOWN, SHORT, TORCH),
        "too few for one update; nothing was learnt from rewards",
        "training diverged",  # tests/train/test_divergence.py
        "Updates run uncompiled, which is slower",  # tests/train/test_compilation.py
    }
    assert set(QUOTED) == set(CALLS) | elsewhere
    assert len(QUOTED) == len(set(QUOTED))


def load(run: Path) -> None:
    """What a run's policy is loaded with."""
    from innerattn.train import load_policy

    load_policy(run)


def one_of_the_page(message: str) -> str:
    """The message of the page that is part of this one."""
    found = [one for one in QUOTED if one in message]
    assert len(found) == 1, message
    return found[0]
