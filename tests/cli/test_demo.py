"""`innerattn demo`: without torch, with the numbers of `innerattn evaluate`."""

import json
import os
import re
import subprocess
import sys
import webbrowser
from pathlib import Path

import pytest

from innerattn.cli import demo
from innerattn.cli.main import main
from innerattn.zoo import read_card

WITHOUT_TORCH = """
import sys

class Refuse:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {"torch", "safetensors", "onnx", "onnxruntime"}:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)

sys.meta_path.insert(0, Refuse())
from innerattn.cli.start import main
sys.exit(main(sys.argv[1:]))
"""
FEW = ("--episodes", "40", "--seed", "9")


def without_torch(folder: Path, *words: str) -> "subprocess.CompletedProcess[str]":
    command = [sys.executable, "-c", WITHOUT_TORCH, *words]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)


@pytest.fixture
def opened(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Addresses that the browser was asked to open, on a machine with a display."""
    found: list[str] = []
    monkeypatch.setattr(webbrowser, "open", lambda address: found.append(address) or True)
    monkeypatch.setattr(demo, "has_display", lambda: True)
    return found


def test_it_runs_without_torch_and_writes_the_page_of_the_team(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    done = without_torch(tmp_path, "demo", "--no-open", *FEW)
    assert (done.returncode, done.stderr) == (0, "")
    assert "demo.html: the team and its world, to play with; open it in a browser\n" in done.stdout
    page = tmp_path / "page.html"
    assert main(["page", "zoo:mixed", "-o", str(page), "--seed", "9"]) == 0
    capsys.readouterr()
    assert (tmp_path / "demo.html").read_bytes() == page.read_bytes()


def test_its_numbers_are_those_of_an_evaluation(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["evaluate", "zoo:mixed", "--json", "-", "--seed", "9", "--score-episodes", "40"]
    assert main([*words, "--episodes", "5", "--long-episodes", "2"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert main(["demo", "--no-open", "-o", str(tmp_path / "a.html"), *FEW]) == 0
    shown = dict(re.findall(r"^  (\S+).*? (\d+\.\d+ ± \d+\.\d+)", capsys.readouterr().out, re.M))
    evaluated = {"zoo:mixed": found["rescues_per_episode"]}
    evaluated |= {name: found["scripted"][name] for name in ("random", "hungarian")}
    assert shown == {
        name: f"{one['mean']:.2f} ± {(one['high'] - one['low']) / 2:.2f}"
        for name, one in evaluated.items()
    }


@pytest.mark.long
def test_it_scores_what_the_card_says(tmp_path: Path) -> None:
    done = without_torch(tmp_path, "demo", "--no-open", "--quiet")
    (mean,) = (
        one["rescues_per_episode"]["mean"]
        for one in read_card("mixed")["lengths"]
        if one["episode_steps"] == 25
    )
    wanted = rf"zoo:mixed: {mean:.2f} ± 0\.05 rescues per episode of 25 steps\n"
    assert re.fullmatch(wanted, done.stdout), done.stderr


def test_it_opens_the_page_where_there_is_a_display(
    tmp_path: Path, opened: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    page = tmp_path / "a b.html"
    assert main(["demo", "-o", str(page), *FEW]) == 0
    assert opened == [page.as_uri()]
    assert f"{page}: the team and its world, to play with; opened" in capsys.readouterr().out
    assert main(["demo", "-o", str(page), "--no-open", *FEW]) == 0
    assert len(opened) == 1


def test_without_a_display_no_browser_is_asked(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "platform", "linux")
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    assert not demo.has_display()
    monkeypatch.setenv("WAYLAND_DISPLAY", "wayland-0")
    assert demo.has_display()


def test_wrong_use(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    cases = [
        (2, ["-o", "demo.gif"], "-o demo.gif: must end in .html"),
        (2, ["--episodes", "0"], "--episodes 0: must be 1 to 1,000,000"),
        (2, ["--seed", "-1"], "--seed -1: must be 0 to 2**63 - 1"),
        (1, ["-o", str(tmp_path / "none" / "page.html")], "none: no such folder"),
    ]
    for code, options, message in cases:
        assert main(["demo", "--no-open", *options]) == code, options
        captured = capsys.readouterr()
        assert message in captured.err
        assert captured.err.count(os.linesep) == 1
        assert not captured.out


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        (("evaluate", "greedy", "--score-episodes", "20", "--long-episodes", "2", "-q"), 0, ""),
        (("replay", "greedy", "--episodes", "1"), 0, ""),
        (("evaluate", "zoo:mixed"), 1, "needs torch: pip install 'innerattn[train]'\n"),
        (("train",), 1, "needs torch: pip install 'innerattn[train]'\n"),
    ],
)
def test_what_needs_no_torch_runs_without_it(
    tmp_path: Path, words: tuple[str, ...], code: int, said: str
) -> None:
    done = without_torch(tmp_path, *words)
    assert done.returncode == code, done.stderr
    assert done.stderr.endswith(said)
    assert done.stderr.count("\n") == (1 if said else 0)
