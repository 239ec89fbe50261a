"""`innerattn info` and what every command shares: help, exit codes, one-line errors."""

import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest

from innerattn.cli.main import COMMANDS, main
from innerattn.config import BUDGETS, SCENARIOS, Map, Scenario


def run(*arguments: str) -> "subprocess.CompletedProcess[str]":
    return subprocess.run(
        [sys.executable, "-m", "innerattn", *arguments], capture_output=True, text=True
    )


def error_of(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    """The one line on standard error of a command that fails with exit code 1."""
    assert main(arguments) == 1
    out, err = capsys.readouterr()
    assert out == ""
    assert err.endswith("\n")
    assert err.count("\n") == 1
    return err.rstrip()


def test_info_names_versions_and_presets(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["info"]) == 0
    rows = dict(line.split(maxsplit=1) for line in capsys.readouterr().out.splitlines())
    assert rows["python"] == sys.version.split()[0]
    assert rows["presets"] == ", ".join(SCENARIOS)
    assert rows["budgets"] == ", ".join(BUDGETS)
    assert {"innerattn", "torch", "numpy", "threads", "device"} <= rows.keys()


def test_info_prints_a_scenario_with_its_defaults(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "mine.toml"
    file.write_text("situation = 'double'\nepisode_steps = 50\n")
    assert main(["info", "--scenario", str(file)]) == 0
    printed = tomllib.loads(capsys.readouterr().out)
    assert Scenario.model_validate(printed) == Scenario(situation="double", episode_steps=50)
    assert printed["rescue_radius_m"] == 0.15


@pytest.mark.parametrize("is_screen", [True, False])
@pytest.mark.parametrize("side", [40, 41, 200])
def test_cells_of_a_large_map_are_joined_on_a_screen_alone(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    side: int,
    is_screen: bool,
) -> None:
    solid = np.random.default_rng(side).random((side, side)) < 0.02
    solid[:, : side // 4] = False
    rows = ["".join("#" if one else "." for one in row) for row in solid]
    file = tmp_path / "large.toml"
    file.write_text(f"[map]\nrows = {rows}\n")
    monkeypatch.setattr(sys.stdout, "isatty", lambda: is_screen, raising=False)
    assert main(["info", "--scenario", str(file)]) == 0
    out = capsys.readouterr().out
    printed = tomllib.loads(out)
    if side == 40 or not is_screen:
        assert Scenario.model_validate(printed).map == Map(rows=rows)
        assert "joined" not in out
        return
    lines = out.splitlines()
    columns = min(side, 76)
    start = lines.index(f"# {side} rows of {side} cells, joined to 40 of {columns} for the screen:")
    assert "rows" not in printed["map"]
    assert lines[start + 41].startswith("# a file gets all rows")
    assert max(len(line) for line in lines[start : start + 42]) <= 78
    drawn = np.array([list(line[2:]) for line in lines[start + 1 : start + 41]]) == "#"
    # The sign of a cell is that in which its middle lies.
    wanted = np.zeros((40, columns), bool)
    for row, column in np.argwhere(solid):
        wanted[int((row + 0.5) * 40 / side), int((column + 0.5) * columns / side)] = True
    np.testing.assert_array_equal(drawn, wanted)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("colour = 1", "scenario.colour: unknown key"),
        ("episode_steps = 0", "scenario.episode_steps = 0: must be"),
        ("= 1", "is not a TOML file"),
    ],
)
def test_wrong_scenario_is_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], text: str, message: str
) -> None:
    file = tmp_path / "wrong.toml"
    file.write_text(text)
    line = error_of(capsys, "info", "--scenario", str(file))
    assert line.startswith(f"innerattn: error: {file}")
    assert message in line


def test_one_thing_is_asked_for_at_a_time(capsys: pytest.CaptureFixture[str]) -> None:
    line = error_of(capsys, "info", "--schema", "run", "--instance", "ral")
    assert line == "innerattn: error: --instance and --schema: must be one of them at a time"


def test_debug_shows_the_traceback(tmp_path: Path) -> None:
    missing = str(tmp_path / "none.toml")
    plain, debug = (run("info", "--scenario", missing, *flag) for flag in ([], ["--debug"]))
    assert plain.returncode == debug.returncode == 1
    assert plain.stderr == f"innerattn: error: cannot read {missing}: No such file or directory\n"
    assert "Traceback" in debug.stderr
    assert "ConfigError" in debug.stderr


@pytest.mark.parametrize(
    "arguments",
    [
        ["frobnicate"],
        ["info", "--frob"],
        ["train", "--preset", "triple"],
        ["train", "--td.gama", "0.9"],
        ["train", "--td.gamma", "high"],
        ["train", "--method", "ppo"],
        ["evaluate"],
        ["evaluate", "random", "--episodes", "many"],
    ],
)
def test_wrong_usage_is_two(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as caught:
        main(arguments)
    assert caught.value.code == 2
    assert capsys.readouterr().out == ""


@pytest.mark.parametrize("command", ["train", "evaluate", "robustness", "reproduce", "info"])
def test_help(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    for arguments in (["--help"], [command, "--help"]):
        with pytest.raises(SystemExit) as caught:
            main(arguments)
        assert caught.value.code == 0
        assert command in capsys.readouterr().out


def test_only_what_exists_is_offered(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["--help"])
    offered = f"{{{','.join(COMMANDS)}}}"
    assert offered in "".join(capsys.readouterr().out.split())
    assert list(COMMANDS)[:3] == ["demo", "train", "evaluate"]


def test_light_imports() -> None:
    heavy = "('torch', 'matplotlib', 'scipy')"
    for code in (
        "import innerattn",
        "from innerattn.cli.main import main; main(['info', '--scenario', '/dev/null'])",
    ):
        code = f"{code}; import sys; print([m for m in {heavy} if m in sys.modules])"
        done = subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, check=True
        )
        assert done.stdout.splitlines()[-1] == "[]"


def test_closed_output_is_no_traceback() -> None:
    command = f"{sys.executable} -m innerattn train --help | head -n 1"
    done = subprocess.run(
        ["bash", "-c", f"set -o pipefail; {command}"], capture_output=True, text=True
    )
    assert "Traceback" not in done.stderr
    assert done.stdout.startswith("usage: innerattn train")
