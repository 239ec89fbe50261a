"""`innerattn new scenario NAME`."""

from pathlib import Path

import pytest

from innerattn.cli.main import main
from innerattn.config import Scenario


def test_a_file_to_begin_with(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["new", "scenario", "flood"]) == 0
    assert Scenario.from_toml("flood.toml") == Scenario()
    assert "innerattn train --scenario flood.toml" in capsys.readouterr().out
    assert main(["info", "--scenario", "flood.toml"]) == 0
    shown = capsys.readouterr().out
    (tmp_path / "shown.toml").write_text(shown)
    assert Scenario.from_toml("shown.toml") == Scenario()
    assert "# 2 m from wall to wall" in shown


def test_a_file_that_is_there_stays(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.toml").write_text("max_victims = 3\n")
    assert main(["new", "scenario", "mine.toml"]) == 1
    assert "mine.toml: is there already; nothing was written" in capsys.readouterr().err
    assert (tmp_path / "mine.toml").read_text() == "max_victims = 3\n"


@pytest.mark.parametrize("name", ["../up", "a b", "", "x" * 65])
def test_a_name_that_is_no_file_is_refused(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["new", "scenario", name]) == 2
    assert "must be 1 to 64 letters" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []
