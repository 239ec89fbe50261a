"""Studies by the command: begun, stopped, killed, gone on with, reported."""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from tiny_study import TINY

from innerattn.cli.main import main
from innerattn.studies.folder import begin_study

FOUR = TINY.replace('"0..2"', '"0..1"')
"""Of four runs."""


@pytest.fixture
def file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "tiny.toml"
    path.write_text(TINY)
    return path


@pytest.mark.long
def test_a_study_from_file_to_report(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["study", "run", str(file)]) == 0
    said = capsys.readouterr().out
    assert "studies/tiny: 6 runs, 0 done, 0 failed, 6 to do by" in said
    assert "inner attention, ppo-inner - ppo-uniform" in said
    folder = Path("studies/tiny")
    found = json.loads((folder / "report.json").read_text())
    assert (len(found["runs"]), found["left_out"]) == (6, [])
    assert [one["seeds"] for one in found["tables"]["Scores"]] == [[0, 1, 2], [0, 1, 2]]
    assert found["contrasts"][0]["seeds"] == [0, 1, 2]
    page = (folder / "report.md").read_text()
    note = "> **Budget quick: a smoke run, no result; its runs are too short to compare methods.**"
    assert page.startswith(f"{note}\n\n# Does inner attention matter?\n")
    assert "given before the first run" in page
    before = (folder / "report.json").read_bytes()
    assert main(["study", "run", str(folder), "-q"]) == 0
    assert (folder / "report.json").read_bytes() == before  # nothing was repeated
    assert main(["study", "status", str(folder)]) == 0
    said = capsys.readouterr().out
    assert "6 runs: 6 done, 0 running, 0 waiting, 0 failed" in said
    assert "rescues, 25 steps" in said  # the table so far
    shutil.rmtree(next((folder / "runs").iterdir()))
    assert main(["study", "status", str(folder)]) == 0
    said = capsys.readouterr().out
    assert re.search(r"A run takes \d+ s; one worker will need about \d+ s more\.", said)
    summary = next((folder / "runs").glob("*/evaluation/summary.json"))
    summary.write_text(summary.read_text() + " ")
    assert main(["study", "status", str(folder)]) == 1
    assert "summary.json: is not the file that manifest.json names" in capsys.readouterr().err


@pytest.mark.long
def test_everything_is_killed_and_goes_on(file: Path) -> None:
    file.write_text(FOUR)
    words = [sys.executable, "-m", "innerattn", "study", "run", str(file), "--workers", "2", "-q"]
    first = subprocess.Popen(words, start_new_session=True)
    work = Path("studies/tiny/work")
    while not (work.exists() and any(work.iterdir())):
        assert first.poll() is None
        time.sleep(0.02)
    os.killpg(first.pid, signal.SIGKILL)
    first.wait()
    assert main(["study", "run", str(file), "-q"]) == 0
    found = json.loads(Path("studies/tiny/report.json").read_text())
    assert (len(found["runs"]), found["left_out"]) == (4, [])
    assert sorted(os.listdir("studies/tiny/runs")) == sorted(one["key"] for one in found["runs"])


@pytest.mark.long
@pytest.mark.usefixtures("interruptible")
def test_ctrl_c_saves_and_frees_every_run(file: Path) -> None:
    """A terminal sends it to all processes of the command; none may take it for a second one."""
    file.write_text(TINY.replace("train.env_steps = 192", "train.env_steps = 1_000_000"))
    words = [sys.executable, "-m", "innerattn", "study", "run", str(file), "--workers", "2", "-q"]
    command = subprocess.Popen(words, start_new_session=True, stderr=subprocess.PIPE, text=True)
    work = Path("studies/tiny/work")
    while len(list(work.glob("*/*/metrics.jsonl"))) < 2:
        assert command.poll() is None
        time.sleep(0.05)
    os.killpg(command.pid, signal.SIGINT)
    _, err = command.communicate(timeout=60)
    assert command.returncode == 130
    assert err == "innerattn: interrupted\n"
    claims = Path("studies/tiny/claims")
    begun = [path for path in claims.iterdir() if path.suffix in (".1", ".2")]
    assert {f"{path.name}.free" for path in begun} == {p.name for p in claims.glob("*.free")}
    assert len(begun) == 2
    for run in work.glob("*/*"):
        assert json.loads((run / "run.json").read_text())["state"] == "interrupted"
        assert any(run.glob("checkpoints/*/checkpoint.json"))


@pytest.mark.long
def test_a_study_that_has_no_more_time_frees_its_runs_and_reports(file: Path) -> None:
    file.write_text(TINY.replace("train.env_steps = 192", "train.env_steps = 1_000_000"))
    words = [sys.executable, "-m", "innerattn", "study", "run", str(file), "--workers", "1"]
    words += ["--until", "8s", "-q"]
    said = subprocess.run(words, check=True, capture_output=True, text=True).stdout
    assert said == "studies/tiny: 0 of 6 runs done\n"
    folder = Path("studies/tiny")
    (run,) = (folder / "work").glob("*/*")
    assert json.loads((run / "run.json").read_text())["state"] == "interrupted"
    assert (folder / "claims" / f"{run.parent.name}.free").exists()
    assert len(json.loads((folder / "report.json").read_text())["left_out"]) == 6


def test_status_and_report_begin_no_study(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for action in ("status", "report"):
        assert main(["study", action, str(file)]) == 1
        assert "holds no study" in capsys.readouterr().err
    assert not Path("studies").exists()


@pytest.mark.long
def test_slurm_runs_workers(file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """With a stand-in for srun, which just runs the command."""
    file.write_text(FOUR)
    assert main(["study", "slurm", str(file), "--workers", "2", "--minutes", "30"]) == 0
    script = capsys.readouterr().out
    assert "#SBATCH --array=1-2\n" in script
    assert "--until 27m\n" in script
    tools = tmp_path / "tools"
    tools.mkdir()
    (tools / "srun").write_text('#!/bin/sh\nexec "$@"\n')
    (tools / "srun").chmod(0o755)
    env = {**os.environ, "PATH": f"{tools}:{os.environ['PATH']}"}
    jobs = [
        subprocess.Popen(["bash", "-c", script], env=env, stdout=subprocess.DEVNULL)
        for _ in range(2)
    ]
    assert [job.wait() for job in jobs] == [0, 0]
    assert main(["study", "status", str(file)]) == 0
    assert "4 done" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "code", "text"),
    [
        (["run", "nothing.toml"], 1, "nothing.toml"),
        (["run", "tiny.txt"], 2, "must be a TOML file, or the folder of a study"),
        (["run", "tiny.toml", "--workers", "0"], 2, "--workers = 0: must be 1 to 256"),
        (["work", "."], 1, "holds no study"),
        (["work", "tiny.toml", "--until", "soon"], 2, "--until = 'soon': must be a time such as"),
        (["run", "tiny.toml", "--until", "1d"], 2, "--until = '1d': must be a time such as"),
        (["slurm", "tiny.toml", "--minutes", "3"], 2, "--minutes = 3: must be above 5"),
    ],
)
@pytest.mark.usefixtures("file")
def test_wrong_usage(
    words: list[str], code: int, text: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["study", *words]) == code
    err = capsys.readouterr().err
    assert text in err
    assert err.count("\n") == 1


def test_runs_that_were_given_up_are_tried_again(
    file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    study = begin_study(file, Path("studies/tiny"))
    first, second = study.planned[:2]
    for _ in range(3):
        claim = study.ledger().claim([first.key])
        assert claim is not None
        claim.fail("RunError: no luck")
    assert main(["study", "status", str(study.path)]) == 1
    assert "failed: mixed ppo-inner tiny, seed 0: RunError: no luck" in capsys.readouterr().err
    assert main(["study", "retry", str(study.path)]) == 0
    said = capsys.readouterr().out
    assert (
        said
        == f"{first}: will be tried again\n1 run to try again: innerattn study run {study.path}\n"
    )
    claim = study.ledger().claim([first.key, second.key])
    assert claim is not None
    assert (claim.key, claim.number) == (first.key, 4)
    claim.free()
    assert main(["study", "retry", str(study.path)]) == 0
    assert capsys.readouterr().out == "0 runs to try again\n"
