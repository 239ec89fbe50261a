"""Commands whose output, errors or input were closed before they began."""

import subprocess
import sys
from pathlib import Path

import pytest

START = "import sys; from innerattn.cli.start import main; sys.exit(main())"


def run(words: list[str], closed: str, folder: Path) -> int:
    """The exit code of a command in a shell that closes some of its streams."""
    script = f'exec "$0" -c "$1" "${{@:2}}" {closed}'
    line = ["bash", "-c", script, sys.executable, START, *words]
    return subprocess.run(line, cwd=folder, check=False, timeout=120).returncode


EVALUATE = ["evaluate", "hungarian", "--episodes", "2", "--score-episodes", "2"]


@pytest.mark.parametrize(
    "closed",
    [
        ">&- 2>&- <&-",
        *(pytest.param(one, marks=pytest.mark.slow) for one in (">&-", "2>&-", "<&-")),
    ],
)
def test_a_training_goes_on_without_its_streams(
    closed: str, tiny: list[str], tmp_path: Path
) -> None:
    assert run(["train", "--run-dir", "run", *tiny], closed, tmp_path) == 0
    assert (tmp_path / "run/evaluation/summary.json").exists()
    for file in (tmp_path / "run").rglob("*"):  # no stray output went into a file
        assert file.is_dir() or b"env-steps/s" not in file.read_bytes()


@pytest.mark.parametrize("closed", [">&-", "2>&-", ">&- 2>&- <&-"])
@pytest.mark.parametrize(
    ("words", "code"),
    [
        (["--version"], 0),
        (["--help"], 0),
        (["info"], 0),
        (["new", "scenario", "flood"], 0),
        pytest.param(
            ["evaluate", "hungarian", "--episodes", "2", "--score-episodes", "2"],
            0,
            marks=pytest.mark.slow,
        ),
        (["nonsense"], 2),
        (["report", "nothing"], 1),
    ],
)
def test_other_commands_end_as_with_them(
    words: list[str], code: int, closed: str, tmp_path: Path
) -> None:
    assert run(words, closed, tmp_path) == code
