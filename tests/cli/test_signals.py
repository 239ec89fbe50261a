"""Signals and lost readers: the exit code, what is left, and one line of text."""

import io
import json
import random
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from innerattn.cli.main import main
from innerattn.signals import Interrupted
from innerattn.train.resume import read_saved
from innerattn.train.saved import whole_checkpoints

pytestmark = pytest.mark.usefixtures("interruptible")
ENDLESS = ("--train.env-steps", "100000000", "--train.compile", "off")
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
IN_TRAINING = (
    signal.SIGTERM,
    *(pytest.param(one, marks=pytest.mark.slow) for one in (signal.SIGINT, signal.SIGHUP)),
)
PARTIAL = re.compile(r"\..+\.([0-9a-f]{16}|[0-9]+)")


@contextmanager
def begin(run: Path, options: list[str]) -> Iterator[subprocess.Popen[str]]:
    """A training, which ends with the test at the latest."""
    command = [sys.executable, "-m", "innerattn", "train", "--run-dir", str(run), *options]
    streams = {"stdout": subprocess.DEVNULL, "stderr": subprocess.PIPE}
    with subprocess.Popen(command, **streams, text=True) as process:  # type: ignore[call-overload]
        try:
            yield process
        finally:
            process.kill()


def left_well(run: Path, sent: signal.Signals, code: int, err: str) -> None:
    """What every interruption leaves."""
    assert code == 128 + sent, err
    assert "Traceback" not in err
    assert "innerattn: interrupted" in err
    assert "altered" not in err
    assert [path for path in run.parent.rglob("*") if PARTIAL.fullmatch(path.name)] == []
    if run.exists():
        state = json.loads((run / "run.json").read_text())["state"]
        assert state in ("interrupted", "done")
        if state == "interrupted":
            assert whole_checkpoints(run / "checkpoints")
            read_saved(run)


def interrupt_at(seconds: float, sent: signal.Signals, run: Path, options: list[str]) -> float:
    """Send a signal to a training some seconds after its start; how long it goes on then [s].

    A training that is done before is begun anew and stopped sooner.
    """
    with begin(run, options) as process:
        time.sleep(seconds)
        if process.poll() is not None:
            assert process.returncode == 0, process.communicate()[1]
            shutil.rmtree(run)
            return interrupt_at(0.8 * seconds, sent, run, options)
        start = time.perf_counter()
        process.send_signal(sent)
        _, err = process.communicate(timeout=120)
        took = time.perf_counter() - start
    if process.returncode == -sent:  # the command was done, and Python was ending itself
        assert (run / "replay.html").exists()
        assert json.loads((run / "run.json").read_text())["state"] == "done"
        assert "Traceback" not in err
        return took
    left_well(run, sent, process.returncode, err)
    return took


@pytest.mark.parametrize("sent", SIGNALS)
def test_while_modules_are_loaded(sent: signal.Signals) -> None:
    command = [sys.executable, "-X", "importtime", "-m", "innerattn", "info"]
    streams = {"stdout": subprocess.DEVNULL, "stderr": subprocess.PIPE}
    with subprocess.Popen(command, **streams, text=True) as process:  # type: ignore[call-overload]
        for line in process.stderr:
            if "numpy" in line:  # long after the start of the command, long before its end
                break
        process.send_signal(sent)
        err = [line for line in process.stderr if not line.startswith("import time:")]
    assert process.returncode == 128 + sent
    assert err == ["innerattn: interrupted\n"]


class Hasty(io.StringIO):
    """What is read by someone who presses Ctrl-C as soon as it says so."""

    pressed = False

    def flush(self) -> None:
        if "Ctrl-C ends it." in self.getvalue() and not self.pressed:
            self.pressed = True
            raise Interrupted(signal.SIGINT)


@pytest.mark.parametrize("command", ["play", "watch"])
def test_as_soon_as_a_page_is_served(
    command: str, run_dir: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = Hasty()
    monkeypatch.setattr(sys, "stdout", out)
    assert main([command, str(run_dir)]) == 0
    assert out.pressed


@pytest.mark.long
@pytest.mark.parametrize("sent", IN_TRAINING)
def test_in_training(sent: signal.Signals, tiny: list[str], tmp_path: Path) -> None:
    run = tmp_path / "run"
    with begin(run, [*tiny, *ENDLESS]) as process:
        while not (run / "metrics.jsonl").exists():
            assert process.poll() is None
            time.sleep(0.05)
        process.send_signal(sent)
        _, err = process.communicate(timeout=120)
    left_well(run, sent, process.returncode, err)
    assert f"go on with: innerattn train --resume {run}" in err


@pytest.mark.long
def test_a_second_one_ends_at_once(tiny: list[str], tmp_path: Path) -> None:
    run = tmp_path / "run"
    with begin(run, [*tiny, *ENDLESS]) as process:
        while not (run / "metrics.jsonl").exists():
            assert process.poll() is None
            time.sleep(0.05)
        process.send_signal(signal.SIGINT)
        time.sleep(0.02)  # the first may have ended it by then
        process.send_signal(signal.SIGINT)
        err = process.communicate(timeout=120)[1]
    assert process.returncode == 130
    assert err.count("innerattn: interrupted") == 1
    assert "Traceback" not in err


@pytest.mark.slow
@pytest.mark.parametrize("number", range(100))
def test_at_any_time(
    number: int, tiny: list[str], tmp_path: Path, record_property: Callable[[str, object], None]
) -> None:
    chance = random.Random(number)
    warm = ["--warm-start", "hungarian", "--imitation.env-steps", "400"]
    often = ["--train.checkpoint-every-env-steps", "32", "--train.env-steps", "1600"]
    seconds, sent = chance.uniform(0.3, 8.0), chance.choice(SIGNALS)
    took = interrupt_at(seconds, sent, tmp_path / "run", [*tiny, *warm, *often])
    # For the table; no time is asserted, since a busy machine takes longer.
    record_property(f"seconds from {sent.name} to the end", took)
    print(f"{sent.name} after {seconds:.1f} s: out after {took:.2f} s")


@pytest.mark.long
def test_nobody_reads_what_it_says(tiny: list[str], tmp_path: Path) -> None:
    run = tmp_path / "run"
    command = [sys.executable, "-m", "innerattn", "train", "--run-dir", str(run), *tiny]
    streams = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT}
    with subprocess.Popen(command, **streams) as process:  # type: ignore[call-overload]
        process.stdout.close()
        assert process.wait(timeout=240) == 0
    assert json.loads((run / "run.json").read_text())["state"] == "done"
    assert (run / "evaluation" / "summary.json").exists()
