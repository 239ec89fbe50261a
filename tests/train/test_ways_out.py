"""However a training ends, its newest checkpoint can be read, and nothing is left lying about."""

import json
import os
import random
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import pytest
from best_line import best_line

from innerattn.config import RunConfig, write_toml
from innerattn.errors import RunError
from innerattn.records.run_folder import newest_weights, read_info
from innerattn.train import DamagedCheckpointError, load_newest, resume, train
from innerattn.train.resume import read_saved
from innerattn.train.saved import whole_checkpoints
from innerattn.train.weights import read_weights

Configure = Callable[..., RunConfig]

OFTEN = {
    "train.checkpoint_every_env_steps": 24,
    "train.checkpoint_every_minutes": 0.0,
    "train.env_steps": 1200,
    "td.replay_capacity": 300,
}
ENDLESS = {**OFTEN, "train.env_steps": 10**9, "train.compile": "off"}
CHILD = """
import sys
from innerattn.config import read_toml
from innerattn.train import resume, train
config, run, first = sys.argv[1:]
train(read_toml(config), run) if first == "new" else resume(run)
"""
PARTIAL = re.compile(r"\..+\.[0-9a-f]{16}")


@contextmanager
def training(config: Path, run: Path, first: str) -> Iterator[subprocess.Popen[str]]:
    command = [sys.executable, "-c", CHILD, str(config), str(run), first]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
        try:
            yield process
        finally:
            process.kill()


def wait_for(process: subprocess.Popen[str], seen: Callable[[], bool]) -> None:
    while not seen():
        assert process.poll() is None, process.communicate()[1]
        time.sleep(0.02)


def newest(run: Path) -> int:
    return max(whole_checkpoints(run / "checkpoints"), default=-1)


def has_newer(run: Path, number: int) -> bool:
    return newest(run) > number


def debris(run: Path) -> list[str]:
    """Names of partial files and folders; a training may remove what is being looked through."""
    entries = (name for _, folders, files in os.walk(run) for name in (*folders, *files))
    return [name for name in entries if PARTIAL.fullmatch(name)]


def kill_again_and_again(config: RunConfig, tmp_path: Path, times: int) -> None:
    """Kill a training at random moments, half of them while it saves; it always goes on."""
    chance = random.Random(times)
    write_toml(config, tmp_path / "config.toml")
    run = tmp_path / "run"
    before = -1
    for kill in range(times):
        with training(tmp_path / "config.toml", run, "go on" if kill else "new") as process:
            wait_for(process, partial(has_newer, run, before))
            if kill % 2:
                wait_for(process, lambda: bool(debris(run / "checkpoints")))
            else:
                time.sleep(chance.uniform(0.0, 0.3))
            at = newest(run)
            process.send_signal(signal.SIGKILL)
            process.wait()
        assert newest(run) >= at
        saved = read_saved(run)
        assert saved.number == saved.info.counters.env_steps == newest(run)
        assert load_newest(run).learner.updates >= 0
        before = saved.number
    assert read_info(run).state == "running"


@pytest.mark.long
def test_a_killed_training_loses_no_checkpoint(small_config: Configure, tmp_path: Path) -> None:
    kill_again_and_again(small_config(**ENDLESS), tmp_path, 4)
    run = tmp_path / "run"
    with pytest.raises(KeyboardInterrupt):
        resume(run, progress=interrupted)
    assert debris(run) == []
    kept = whole_checkpoints(run / "checkpoints")
    assert len(kept) == 2


@pytest.mark.slow
def test_two_hundred_kills(small_config: Configure, tmp_path: Path) -> None:
    kill_again_and_again(small_config(**ENDLESS), tmp_path, 200)


def interrupted(_: object) -> None:
    raise KeyboardInterrupt


@pytest.mark.long
@pytest.mark.parametrize("name", ["weights", "state", "checkpoint", "rows", "metrics"])
def test_a_flipped_byte_is_named_and_the_checkpoint_before_it_is_there(
    small_config: Configure, tmp_path: Path, name: str
) -> None:
    run = tmp_path / "run"
    with pytest.raises(KeyboardInterrupt):
        train(small_config(**OFTEN), run, progress=after(600))
    info = json.loads((run / "run.json").read_text())
    (run / "run.json").write_text(json.dumps(info | {"state": "running", "sealed": False}))
    folder = run / "checkpoints" / str(newest(run))
    file = {
        "weights": folder / "weights.safetensors",
        "state": folder / "state.safetensors",
        "checkpoint": folder / "checkpoint.json",
        "rows": max((run / "checkpoints" / "rows").iterdir(), key=os.path.getmtime),
        "metrics": run / "metrics.jsonl",
    }[name]
    data = bytearray(file.read_bytes())
    data[len(data) // 3] ^= 4
    file.write_bytes(data)
    with pytest.raises(DamagedCheckpointError, match=re.escape(str(file))):
        resume(run)
    if name in ("weights", "state", "checkpoint"):
        before = whole_checkpoints(run / "checkpoints")[-2]
        with pytest.raises(RunError, match=f"remove {re.escape(str(folder))} to go on"):
            resume(run)
        for path in folder.iterdir():
            path.unlink()
        folder.rmdir()
        assert read_saved(run).number == before
        with pytest.raises(KeyboardInterrupt):
            resume(run, progress=interrupted)


def after(env_steps: int) -> Callable[[object], None]:
    def stop(now: object) -> None:
        if now.env_steps >= env_steps:  # type: ignore[attr-defined]
            raise KeyboardInterrupt

    return stop


def test_a_checkpoint_that_fails_half_way_leaves_nothing(
    small_config: Configure, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        raise OSError(28, "No space left on device")

    run = tmp_path / "run"
    with monkeypatch.context() as patched:
        patched.setattr("innerattn.train.saved.checkpoint_text", fail)
        with pytest.raises(KeyboardInterrupt):
            train(small_config(**OFTEN), run, progress=after(120))
    assert newest(run) == -1
    assert debris(run) == []
    assert read_info(run).state == "interrupted"


def test_two_trainings_in_one_folder_are_refused(small_config: Configure, tmp_path: Path) -> None:
    run = tmp_path / "run"

    def second(now: object) -> None:
        if now.env_steps == 240:  # type: ignore[attr-defined]
            with pytest.raises(RunError, match="another process is training in it"):
                resume(run)

    train(small_config(**OFTEN), run, progress=second)


@pytest.mark.parametrize("end", [None, 1])
def test_the_best_weights_are_those_of_the_best_line(
    end: int | None, small_config: Configure, tmp_path: Path
) -> None:
    """With ``end`` the first episode that ends has the most rescues there can be."""
    easy = {"scenario.end_when_rescued": end, "scenario.rescue_radius_m": 0.6}
    run = train(small_config(**OFTEN, **easy), tmp_path / "run")
    lines = [json.loads(line) for line in (run / "metrics.jsonl").read_text().splitlines()]
    first = next(line for line in lines if line["episodes"])
    best = best_line(run)
    assert best > first["env_steps"] or end is None
    weights = read_weights(run / "checkpoints" / f"best-{best}.safetensors")
    assert int(weights["updates"]) == next(
        line["updates"] for line in lines if line["env_steps"] == best
    )
    assert newest_weights(run).parent.name == "1200"
