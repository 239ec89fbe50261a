"""Words of strangers on a terminal: names of keys and folders, and what files hold."""

import io
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from innerattn.cli.main import main
from innerattn.cli.plain import Escaping, PlainConsole, escaped_output
from innerattn.cli.progress import Work
from innerattn.cli.streams import Droppable
from innerattn.errors import plain

NASTY = "a\x1b[31mb\x07c\x9bd\u202ee\u200bf\udcffg"
SHOWN = r"a\x1b[31mb\x07c\x9bd\u202ee\u200bf\udcffg"


@given(st.text())
def test_plain_text_is_seen_and_moves_nothing(text: str) -> None:
    found = plain(text)
    assert all(one.isprintable() or one in "\n\t" for one in found)
    assert plain(found) == found
    if all(one.isprintable() for one in text):
        assert found == text


def test_all_ways_out_are_plain() -> None:
    assert plain(NASTY) == SHOWN
    raw = io.StringIO()
    stream = Escaping(raw)
    print(NASTY, file=stream)  # type: ignore[arg-type]
    assert raw.getvalue() == f"{SHOWN}\n"
    drawn = io.StringIO()
    console = PlainConsole(file=drawn, force_terminal=True, markup=False, highlight=False)
    console.print(NASTY, style="bold", soft_wrap=True)
    assert drawn.getvalue() == f"\x1b[1m{SHOWN}\x1b[0m\n"


def test_what_rich_draws_passes_both_streams(monkeypatch: pytest.MonkeyPatch) -> None:
    raw = io.StringIO()
    monkeypatch.setattr(sys, "stdout", Droppable(Escaping(raw)))  # type: ignore[arg-type]
    PlainConsole(force_terminal=True).print("[bold]x")
    assert raw.getvalue() == "\x1b[1mx\x1b[0m\n"


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.mark.parametrize("wrap", [lambda raw: raw, Droppable])
def test_a_bar_is_drawn_and_what_is_printed_beside_it_is_plain(
    wrap: Callable[[io.StringIO], io.StringIO], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("TERM", "xterm")
    raw = Terminal()
    monkeypatch.setattr(sys, "stdout", wrap(raw))
    monkeypatch.setattr(sys, "stderr", wrap(raw))
    with escaped_output():
        outside = sys.stderr
        with Work(PlainConsole(stderr=True, force_terminal=True, width=100)) as work:
            work.show(1, 2, "a\u202eb")
            print(NASTY, file=sys.stderr)
            print(NASTY)
        assert sys.stderr is outside
    shown = raw.getvalue()
    assert shown.count(SHOWN) == 2
    assert "\u2501" in shown  # the bar
    assert "\x1b[2K" in shown
    assert r"a\u202eb" in shown
    assert r"\x1b[" not in shown.replace(SHOWN, "")
    assert all(one.isprintable() or one in "\r\n\x1b" for one in shown)


def test_a_key_of_a_file_is_escaped(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "world.toml"
    file.write_text('"a\\u001B[2Jb\\u202E" = 1\n')
    assert main(["info", "--scenario", str(file)]) == 1
    assert r"a\x1b[2Jb\u202e: unknown key" in capfd.readouterr().err


@pytest.mark.parametrize("name", ["r\x1b[2J\x07un", "r\u202eun"])
def test_a_folder_s_name_is_escaped(
    name: str, run_dir: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    run = Path(shutil.copytree(run_dir, tmp_path / name))
    assert main(["replay", str(run), "-o", str(run) + ".html"]) == 0
    assert main(["report", str(run) + "x"]) == 1
    assert main(["evaluate", str(run), "--score-episodes", "4", "--episodes", "2"]) == 0
    for text in capfd.readouterr():
        assert "\x1b" not in text
        assert "\u202e" not in text


@pytest.mark.parametrize("words", [("report",), ("replay", "-o", "page.html")])
def test_a_folder_whose_name_is_no_utf8(
    words: tuple[str, ...], run_dir: Path, tmp_path: Path
) -> None:
    name = os.path.join(os.fsencode(tmp_path), b"run\xff")
    shutil.copytree(os.fsencode(run_dir), name)
    line = [sys.executable, "-m", "innerattn", words[0], name, *words[1:]]
    done = subprocess.run(line, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert "Traceback" not in done.stderr
    assert done.returncode == 0, done.stderr
    assert r"run\udcff" in max(tmp_path.glob("*.html")).read_text("utf-8")
