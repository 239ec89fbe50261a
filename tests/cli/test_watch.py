"""`innerattn watch`: the page of a training in a browser, and what is refused."""

import json
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from browser import PHONE, WIDE, Visit, opened_browser, until
from reseal import reseal
from tiny_study import TINY

from innerattn.cli.main import main
from innerattn.cli.watch import Watch, _scripts_beside
from innerattn.errors import RunError
from innerattn.records.run_files import seal
from innerattn.records.run_folder import run_info
from innerattn.studies.folder import begin_study
from innerattn.studies.work import work

FRAME = "document.querySelector('#episodes')"
INSIDE = f"{FRAME}.contentDocument?.documentElement?"


def mark(run: Path, **values: Any) -> None:
    """Change what ``run.json`` says, whole, as training does."""
    document = json.loads((run / "run.json").read_text()) | values
    (run / "new.json").write_text(json.dumps(document))
    (run / "new.json").replace(run / "run.json")


@pytest.mark.long
@pytest.mark.usefixtures("interruptible")
def test_a_training_goes_on_under_the_eyes_of_its_reader(run_dir: Path, tmp_path: Path) -> None:
    run = Path(shutil.copytree(run_dir, tmp_path / "mine <b>"))
    lines = (run / "metrics.jsonl").read_text().splitlines(keepends=True)
    (run / "metrics.jsonl").write_text(lines[0])
    (run / "checkpoints").rename(run / "later")
    mark(run, state="running", sealed=False, env_steps=json.loads(lines[0])["env_steps"])
    command = [sys.executable, "-m", "innerattn", "watch", str(run), "--episodes", "2"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    problems: list[str] = []
    try:
        address = process.stdout.readline().split()[-1]
        with opened_browser() as browser:
            page = browser.new_page(viewport={"width": WIDE[0], "height": WIDE[1]})
            page.on("pageerror", lambda error: problems.append(str(error)))
            page.on("console", lambda m: problems.append(m.text) if m.type == "error" else None)
            page.goto(address)
            page.get_by_text("1 of 1 running.").wait_for()
            row = page.locator("#runs tr")
            assert row.locator("th").inner_text() == "mine <b>"
            assert row.locator("td").last.inner_text() == "none yet"
            assert page.get_by_text("The first checkpoint is not there yet.").is_visible()
            (run / "metrics.jsonl").write_text("".join(lines))
            (run / "later").rename(run / "checkpoints")
            ended = {"state": "done", "env_steps": 400}
            seal(run, run_info(json.loads((run / "run.json").read_text()) | ended))
            page.get_by_text("All trainings have ended.").wait_for()
            assert row.locator("td").nth(2).inner_text() == "400"
            replay = page.frame_locator("#episodes")
            replay.get_by_role("heading", level=1).get_by_text("after 400 env-steps").wait_for()
            replay.get_by_role("button", name="Next event").click()
            assert replay.locator("#episode option").count() == 2
            until(page, "document.querySelectorAll('.plot .picture').length === 2")
            until(page, f"{FRAME}.clientHeight >= {INSIDE}.offsetHeight")
            page.get_by_role("button", name="Dark").click()
            until(page, f"{INSIDE}.dataset.theme === 'dark'")
            page.get_by_role("button", name="after 400").click()  # loads the replay anew
            until(page, f"{INSIDE}.dataset.theme === 'dark'")
            replay.locator("#theme").wait_for(state="hidden")
            assert not Visit(page).serious_faults()
            page.set_viewport_size({"width": PHONE[0], "height": PHONE[1]})
            until(page, f"document.documentElement.scrollWidth <= {PHONE[0]}")
            assert not problems
    finally:
        process.send_signal(signal.SIGINT)
        assert process.wait(timeout=30) == 0
        process.stdout.close()


def test_wrong_use(run_dir: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = str(taken.getsockname()[1])
        cases = [
            (2, [], "RUN: at least one run is needed"),
            (1, ["nobody"], "nobody: no such run folder"),
            (2, [str(run_dir), "--port", "70000"], "--port 70000: must be 0 to 65,535"),
            (2, [str(run_dir), "--episodes", "0"], "--episodes 0: must be 1 to 100"),
            (1, [str(run_dir), "--port", port], f"--port {port}: is taken"),
        ]
        for code, options, message in cases:
            assert main(["watch", *options]) == code
            captured = capsys.readouterr()
            assert message in captured.err
            assert captured.err.count(os.linesep) == 1
            assert not captured.out


def test_a_folder_of_runs_stands_for_its_runs(
    run_dir: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    runs = tmp_path / "runs"
    for name in ("b", "a", "damaged"):
        shutil.copytree(run_dir, runs / name)
    (runs / "notes").mkdir()
    (runs / "damaged" / "metrics.jsonl").write_text("[")
    assert Watch(runs=[str(runs), str(runs / "a")])._folders() == [runs / "a", runs / "b"]
    said = capsys.readouterr().err
    assert said.startswith(f"innerattn: left out: {runs / 'damaged'}")
    assert said.count("\n") == 1
    with pytest.raises(RunError, match="not the metrics of a run"):
        Watch(runs=[str(runs / "damaged")])._folders()
    shutil.rmtree(runs / "a")
    shutil.rmtree(runs / "b")
    with pytest.raises(RunError, match="no run in it can be read"):
        Watch(runs=[str(runs)])._folders()
    with pytest.raises(RunError, match=r"run\.json: missing"):
        Watch(runs=[str(runs / "notes")])._folders()


def test_runs_that_begin_later_come_last(
    run_dir: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("innerattn.cli.watch._scripts_beside", lambda _: {"hungarian": 2.0})
    runs = tmp_path / "runs"
    shutil.copytree(run_dir, runs / "b")
    pages = Watch(runs=[str(runs)])._pages()

    def shown() -> tuple[list[str], bool]:
        state = json.loads(pages["state"]().text)
        return [one["name"] for one in state["runs"]], bool(state["plots"][0]["levels"])

    assert shown() == (["b"], True)
    shutil.copytree(run_dir, runs / "a")
    (runs / "begun").mkdir()  # nothing is in it yet
    (runs / "begun/run.json").write_text("{")
    assert shown() == (["b", "a"], True)
    assert {"episodes/0", "episodes/1"} <= pages.keys()
    assert "episodes/2" not in pages
    other = Path(shutil.copytree(run_dir, runs / "c"))
    config = other / "config.toml"
    config.write_text(config.read_text().replace('"mixed"', '"double"'))
    reseal(other)
    assert shown() == (["b", "a", "c"], False), "scripts of other worlds are no measure"


def test_scripts_stand_beside_runs_of_the_same_worlds_only(run_dir: Path, tmp_path: Path) -> None:
    other = Path(shutil.copytree(run_dir, tmp_path / "other"))
    assert _scripts_beside([run_dir, other]).keys() == {"hungarian", "greedy"}
    config = other / "config.toml"
    config.write_text(config.read_text().replace('"mixed"', '"double"'))
    reseal(other)
    assert _scripts_beside([run_dir, other]) == {}


def test_no_script_stands_beside_a_run_for_many_teams(run_dir: Path, tmp_path: Path) -> None:
    run = Path(shutil.copytree(run_dir, tmp_path / "other"))
    config = run / "config.toml"
    text = re.sub(r'(?m)^method = ".*"$', 'method = "team-max"', config.read_text())
    config.write_text(f"{text}\n[family]\nrobots = [2, 3]\n")
    reseal(run)
    assert _scripts_beside([run]) == {}


@pytest.mark.long
@pytest.mark.usefixtures("interruptible")
def test_a_study_is_watched_while_it_goes_on(tmp_path: Path) -> None:
    file = tmp_path / "tiny.toml"
    file.write_text(TINY)
    study = begin_study(file, tmp_path / "study")
    command = [sys.executable, "-m", "innerattn", "watch", str(study.path)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    problems: list[str] = []
    try:
        address = process.stdout.readline().split()[-1]
        with opened_browser() as browser:
            page = browser.new_page(viewport={"width": WIDE[0], "height": WIDE[1]})
            page.on("pageerror", lambda error: problems.append(str(error)))
            page.on("console", lambda m: problems.append(m.text) if m.type == "error" else None)
            page.goto(address)
            page.get_by_text("0 of 6 runs are done, 0 running, 6 waiting.").wait_for()
            assert page.locator("h1").inner_text() == "Does inner attention matter?"
            assert page.locator("#scores-part").is_hidden()
            claim = study.ledger().claim(run.key for run in study.planned[-1:])
            assert claim is not None
            work(study.ledger(), study.planned[:4])
            claim.fail("Traceback\nRunError: no luck <b>")
            page.get_by_text("4 of 6 runs are done").wait_for()
            assert page.locator("#scores tr").count() == 2
            assert "undecided" in page.locator("#verdicts li").inner_text()
            claim = study.ledger().claim(run.key for run in study.planned[4:])
            assert claim is not None
            page.get_by_text("4 of 6 runs are done, 1 running, 1 waiting.").wait_for()
            assert page.locator("#running th").inner_text() == str(study.planned[4])
            for _ in range(3):
                claim.fail("RunError: no luck <b>")
                claim = study.ledger().claim([study.planned[4].key])
            page.get_by_text("1 failed").wait_for()
            failed = page.locator("#failed li").inner_text()
            assert failed == f"{study.planned[4]}: RunError: no luck <b>"
            assert not Visit(page).serious_faults()
            page.set_viewport_size({"width": PHONE[0], "height": PHONE[1]})
            until(page, f"document.documentElement.scrollWidth <= {PHONE[0]}")
            assert not problems
    finally:
        process.send_signal(signal.SIGINT)
        assert process.wait(timeout=30) == 0
        process.stdout.close()
