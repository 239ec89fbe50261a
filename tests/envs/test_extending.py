"""The page about scenarios of one's own shows what works."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from innerattn.config import Scenario
from innerattn.errors import ConfigError

PAGE = Path(__file__).parents[2] / "docs" / "extending" / "scenario.md"


def blocks(language: str) -> list[str]:
    """The code blocks of a language on the page."""
    return re.findall(rf"```{language}\n(.*?)```", PAGE.read_text("utf-8"), flags=re.DOTALL)


@pytest.fixture
def harbour(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A folder with the page's file."""
    (scenario,) = blocks("toml")
    (tmp_path / "harbour.toml").write_text(scenario, "utf-8")
    monkeypatch.chdir(tmp_path)


@pytest.mark.usefixtures("harbour")
def test_the_scenario_in_python_is_the_one_in_the_file() -> None:
    (example,) = blocks("python")
    exec(compile(example, str(PAGE), "exec"), {})


@pytest.mark.long
@pytest.mark.usefixtures("harbour")
def test_the_commands_run() -> None:
    commands, _ = blocks("sh")  # the second trains
    for command in commands.splitlines():
        program, *words = command.split()
        assert program == "innerattn"
        done = subprocess.run(
            [sys.executable, "-m", program, *words], capture_output=True, text=True
        )
        assert done.returncode == 0, done.stderr
        assert done.stdout


def test_the_page_shows_a_refusal_as_it_is(tmp_path: Path) -> None:
    (scenario,) = blocks("toml")
    alone = scenario.replace('abilities = ["rescue", "water"]', 'abilities = ["rescue"]', 1)
    (tmp_path / "alone.toml").write_text(alone, "utf-8")
    with pytest.raises(ConfigError) as error:
        Scenario.from_toml(tmp_path / "alone.toml")
    text = str(error.value).removeprefix(f"{tmp_path / 'alone.toml'}: ")
    assert f"`{text}`" in PAGE.read_text("utf-8")
