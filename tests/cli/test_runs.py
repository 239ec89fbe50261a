"""Runs by name: a path first, then `latest`, then the one run whose name begins so."""

import json
import os
import shutil
from pathlib import Path

import pytest

from innerattn.cli.main import main
from innerattn.cli.runs import existing_run, named_policy, named_run, shown_names
from innerattn.errors import RunError
from innerattn.zoo import run_path


@pytest.fixture
def runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder `runs` in the current one with three runs, begun in this order: b, a-1, a-2."""
    monkeypatch.chdir(tmp_path)
    for second, name in enumerate(("b", "a-1", "a-2")):
        folder = tmp_path / "runs" / name
        folder.mkdir(parents=True)
        (folder / "run.json").write_text("{}")
        (folder / "config.toml").write_text("")
        os.utime(folder / "config.toml", (second, second))
    (tmp_path / "runs" / "notes").mkdir()
    (tmp_path / "runs" / "log.txt").write_text("")
    return tmp_path / "runs"


@pytest.mark.usefixtures("runs")
def test_names() -> None:
    assert named_run("latest") == Path("runs/a-2")
    assert named_run("b") == Path("runs/b")
    assert named_run("a-1") == Path("runs/a-1")
    assert named_run("runs/a-1") == Path("runs/a-1")
    for other in ("notes", "log", "c", "runs/a", "../a"):  # no run of that name is there
        assert named_run(other) == Path(other)


def test_the_latest_is_the_one_that_was_begun_last(runs: Path) -> None:
    os.utime(runs / "b" / "config.toml", (9, 9))
    assert named_run("latest") == Path("runs/b")
    os.utime(runs / "a-1" / "run.json", (99, 99))  # measured again, say
    assert named_run("latest") == Path("runs/b")


@pytest.mark.usefixtures("runs")
def test_several_runs_of_a_name_are_listed() -> None:
    with pytest.raises(RunError) as error:
        named_run("a")
    assert str(error.value) == "a: 2 runs in runs begin so: a-1, a-2"


def test_a_whole_name_wins_over_a_longer_one(runs: Path) -> None:
    shutil.copytree(runs / "a-1", runs / "a-11")
    assert named_run("a-1") == Path("runs/a-1")
    with pytest.raises(RunError, match="3 runs in runs begin so: a-1, a-11, a-2"):
        named_run("a-")


def test_a_path_always_wins(runs: Path) -> None:
    for name in ("latest", "a", "b"):
        (runs.parent / name).mkdir()
        assert named_run(name) == Path(name)


def test_scripts_win_over_runs(runs: Path) -> None:
    (runs / "b").rename(runs / "random-1")
    assert named_policy("random", ("random", "greedy")) == "random"
    assert named_policy("random-", ("random", "greedy")) == os.path.join("runs", "random-1")
    with pytest.raises(RunError, match=r"nor one of random, greedy, did you mean greedy\?$"):
        named_policy("gredy", ("random", "greedy"))


@pytest.mark.parametrize(
    ("wrong", "meant"), [("lates", "latest"), ("a-1x", "a-1"), ("zoo:mixd", "zoo:mixed")]
)
def test_a_misspelt_run_is_asked_for(runs: Path, wrong: str, meant: str) -> None:
    assert (runs / "a-1").is_dir()
    with pytest.raises(RunError, match=f", did you mean {meant}\\?$"):
        named_policy(wrong, ("random", "greedy"))


@pytest.mark.parametrize(
    "command",
    ["evaluate", "export", "page", "play", "replay", "report", "robustness", "train", "watch"],
)
def test_every_command_asks_for_a_misspelt_run(
    runs: Path, command: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(runs.parent)
    words = ["--resume"] if command == "train" else []
    assert main([command, *words, os.path.join("runs", "a-1x")]) == 1
    meant = os.path.join("runs", "a-1")
    assert capsys.readouterr().err.endswith(f", did you mean {meant}?\n")


def test_a_long_path_makes_no_names_alike(runs: Path) -> None:
    with pytest.raises(RunError, match=r"quite-another: no such run folder$"):
        existing_run(str(runs / "quite-another"))


def test_without_runs_there_is_no_latest(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(RunError, match="latest: no run is in runs yet"):
        named_run("latest")


@pytest.mark.long
def test_commands_take_names(
    run_dir: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    shutil.copytree(run_dir, tmp_path / "runs" / "mine-s0")
    few = ["--episodes", "4", "--score-episodes", "6", "--long-episodes", "2"]
    assert main(["evaluate", "latest", *few, "--json", "-"]) == 0
    assert json.loads(capsys.readouterr().out)["policy"] == "mine-s0"
    assert main(["evaluate", "latest", *few, "--quiet"]) == 0
    assert capsys.readouterr().out.startswith(f"{Path('runs', 'mine-s0')}: ")
    assert main(["replay", "mine", "-o", "a.html"]) == 0
    assert main(["report", "latest", "-o", "b.html"]) == 0
    assert (tmp_path / "a.html").exists()
    assert (tmp_path / "b.html").exists()
    assert main(["train", "--resume", "latest"]) == 1
    assert "runs/mine-s0: is done" in capsys.readouterr().err
    faults = ["--episodes", "2", "--faults", "blackout", "--quiet"]
    assert main(["robustness", "mine", *faults]) == 0
    (line,) = capsys.readouterr().out.splitlines()[-1:]
    assert line.startswith("Share of rescues kept when a robot fails: mine-s0 ")
    shutil.copytree(run_dir, tmp_path / "runs" / "mine-s1")
    for command in ("evaluate", "replay", "report", "robustness", "watch", "play"):
        assert main([command, "mine"]) == 1
        err = capsys.readouterr().err
        assert err == "innerattn: error: mine: 2 runs in runs begin so: mine-s0, mine-s1\n"


def test_teams_of_the_package_are_not_gone_on_with(capsys: pytest.CaptureFixture[str]) -> None:
    before = sorted(run_path("zoo:mixed").rglob("*"))
    assert main(["train", "--resume", "zoo:mixed"]) == 1
    assert capsys.readouterr().err.splitlines() == [
        "innerattn: error: zoo:mixed: a team of the package is done, nothing to go on from"
    ]
    assert sorted(run_path("zoo:mixed").rglob("*")) == before


def test_two_policies_have_two_names() -> None:
    def shown(*policies: str) -> list[str]:
        return shown_names(policies, ("greedy", "random"))

    assert shown("runs/a", "greedy") == ["a", "greedy"]
    assert shown("runs/a", "other/a") == ["runs/a", "other/a"]
    assert shown("runs/a", "runs/a") == ["a", "a"]
    assert shown("greedy", "runs/greedy") == ["greedy", "greedy (run)"]
    assert shown("x/greedy", "y/greedy") == ["x/greedy", "y/greedy"]
