"""Commands whose output, errors or input were closed before they began."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

START = "import sys; from innerattn.cli.start import main; sys.exit(main())"
START_EACH = """
import json, os, sys
import innerattn.cli.main  # it takes a second, and each command needs it
from innerattn.cli.start import main
codes = []
for words in json.loads(sys.argv[1]):
    process = os.fork()
    if process == 0:
        sys.argv[1:] = words
        sys.exit(main())
    codes.append(os.waitstatus_to_exitcode(os.waitpid(process, 0)[1]))
with open("codes.json", "w") as file:
    json.dump(codes, file)
"""


def run(code: str, words: list[str], closed: str, folder: Path) -> int:
    """The exit code of Python in a shell that closes some of its streams."""
    script = f'exec "$0" -c "$1" "${{@:2}}" {closed}'
    line = ["bash", "-c", script, sys.executable, code, *words]
    return subprocess.run(line, cwd=folder, check=False, timeout=120).returncode


EVALUATE = ["evaluate", "hungarian", "--episodes", "2", "--score-episodes", "2"]
OTHERS = {
    ("--version",): 0,
    ("--help",): 0,
    ("info",): 0,
    ("new", "scenario", "flood"): 0,
    ("nonsense",): 2,
    ("report", "nothing"): 1,
}
"""Other commands, and their exit codes."""


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
    assert run(START, ["train", "--run-dir", "run", *tiny], closed, tmp_path) == 0
    assert (tmp_path / "run/evaluation/summary.json").exists()
    for file in (tmp_path / "run").rglob("*"):  # no stray output went into a file
        assert file.is_dir() or b"env-steps/s" not in file.read_bytes()


@pytest.mark.parametrize(
    "closed",
    [">&- 2>&- <&-", *(pytest.param(one, marks=pytest.mark.slow) for one in (">&-", "2>&-"))],
)
def test_other_commands_end_as_with_them(closed: str, tmp_path: Path) -> None:
    assert run(START_EACH, [json.dumps(list(OTHERS))], closed, tmp_path) == 0
    codes = json.loads((tmp_path / "codes.json").read_text())
    assert dict(zip(OTHERS, codes, strict=True)) == OTHERS


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no device that is full")
@pytest.mark.parametrize("buffered", ["", "1"])
@pytest.mark.parametrize("words", [["--version"], ["train", "--help"], ["new", "scenario", "x"]])
def test_a_standard_output_that_is_full_is_named(
    words: list[str], buffered: str, tmp_path: Path
) -> None:
    done = subprocess.run(
        ["bash", "-c", 'exec "$0" -c "$@" >/dev/full', sys.executable, START, *words],
        env={**os.environ, "PYTHONUNBUFFERED": buffered},
        cwd=tmp_path,
        stderr=subprocess.PIPE,
        text=True,
        check=False,
        timeout=120,
    )
    assert done.returncode == 1
    assert done.stderr == "innerattn: error: standard output: No space left on device\n"


@pytest.mark.slow
@pytest.mark.parametrize("closed", [">&-", "2>&-", ">&- 2>&- <&-"])
def test_an_evaluation_ends_as_with_them(closed: str, tmp_path: Path) -> None:
    assert run(START, EVALUATE, closed, tmp_path) == 0
