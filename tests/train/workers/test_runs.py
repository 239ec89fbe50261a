"""Trainings by several processes: the same bits every time, also after a stop or a kill."""

import hashlib
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from innerattn.config import RunConfig, load_run_config, write_toml
from innerattn.errors import ConfigError, RunError
from innerattn.records.run_folder import newest_weights, read_info
from innerattn.train import Progress, resume, train
from innerattn.train.weights import digest_of
from innerattn.train.workers.start import MODULE

SMALL = {
    "train.workers": 2,
    "train.env_steps": 480,
    "train.checkpoint_every_env_steps": 120,
    "train.checkpoint_every_minutes": 0.0,
    "ppo.rollout_steps": 7,
    "ppo.minibatch_size": 32,
    "network.attention_heads": 2,
    "td.replay_capacity": 300,
    "td.update_every_env_steps": 5,
    "td.warmup_env_steps": 100,
}
WARM = {
    "train.warm_start": "hungarian",
    "imitation.env_steps": 300,
    "imitation.critic_env_steps": 200,
    "imitation.batch_size": 32,
    "imitation.update_every_env_steps": 24,
    "imitation.memory_env_steps": 130,
}
CASES: dict[str, dict[str, Any]] = {
    "td-inner": {"train.method": "td-inner"},
    "mappo, three workers, augmented": {
        "train.method": "mappo",
        "train.workers": 3,
        "network.symmetry": "augmented",
        "train.stagger_starts": True,
    },
    "mappo, memory": {
        "train.method": "mappo",
        "network.memory_width": 4,
        "network.symmetry": "canonical",
        "ppo.sequence_steps": 7,
    },
    "ppo-inner, messages": {
        "train.method": "ppo-inner",
        "network.message_width": 4,
        "network.symmetry": "canonical",
        "scenario.communication": {"range_m": 1.2, "delay_steps": 1},
    },
    "ppo-inner, warm start, afterstates": {
        "train.method": "ppo-inner",
        "ppo.bootstrap": "afterstate",
        "scenario.rescue_radius_m": 0.9,
        **WARM,
    },
}
Configure = Callable[..., RunConfig]


def left_by(run: Path) -> tuple[str, str]:
    """Digests of the weights and of all that the metrics say but for the time."""
    lines = [json.loads(line) for line in (run / "metrics.jsonl").read_text().splitlines()]
    for line in lines:
        for name in ("seconds", "env_steps_per_s", "updates_per_s"):
            del line[name]
    text = json.dumps(lines)
    return digest_of(newest_weights(run)), hashlib.sha256(text.encode()).hexdigest()


def workers_of(process: int) -> list[int]:
    """The other workers that a process has started and that live."""
    return [
        int(entry.name)
        for entry in Path("/proc").glob("[0-9]*")
        if _parent_of(entry) == process and MODULE.encode() in (entry / "cmdline").read_bytes()
    ]


def _parent_of(entry: Path) -> int | None:
    """Of a process that lives: no zombie."""
    try:
        state, parent = (entry / "stat").read_text().rpartition(")")[2].split()[:2]
    except OSError:
        return None
    return None if state == "Z" else int(parent)


def gone(process: int, seconds: float = 30.0) -> bool:
    end = time.monotonic() + seconds
    while time.monotonic() < end and _parent_of(Path(f"/proc/{process}")) is not None:
        time.sleep(0.05)
    return time.monotonic() < end


def stops_after(steps: int) -> Callable[[Progress], None]:
    seen = 0

    def progress(_: Progress) -> None:
        nonlocal seen
        seen += 1
        if seen == steps:
            raise KeyboardInterrupt

    return progress


@pytest.fixture(scope="module")
def whole(
    small_config: Configure, tmp_path_factory: pytest.TempPathFactory
) -> Callable[[str], tuple[str, str]]:
    """What a case leaves that is not cut, by its name."""
    found: dict[str, tuple[str, str]] = {}

    def left(case: str) -> tuple[str, str]:
        if case not in found:
            config = small_config(**{**SMALL, **CASES[case]})
            found[case] = left_by(train(config, tmp_path_factory.mktemp("whole") / "run"))
        return found[case]

    return left


@pytest.mark.long
@pytest.mark.parametrize("case", CASES)
def test_a_run_that_is_stopped_goes_on_to_the_same_bits(
    case: str, whole: Callable[[str], tuple[str, str]], small_config: Configure, tmp_path: Path
) -> None:
    config = small_config(**{**SMALL, **CASES[case]})
    with pytest.raises(KeyboardInterrupt):
        train(config, tmp_path / "cut", progress=stops_after(15))
    cut = tmp_path / "cut"
    info = read_info(cut)
    assert info.state == "interrupted"
    assert 0 < info.env_steps < 480 + 300
    assert not workers_of(os.getpid())
    assert left_by(resume(cut)) == whole(case)
    assert read_info(cut).state == "done"


@pytest.mark.long
def test_a_worker_that_is_killed_ends_the_run_which_goes_on_to_the_same_bits(
    whole: Callable[[str], tuple[str, str]], small_config: Configure, tmp_path: Path
) -> None:
    config = small_config(**{**SMALL, **CASES["td-inner"]})
    seen = 0

    def kill(_: Progress) -> None:
        nonlocal seen
        seen += 1
        if seen == 25:
            (other,) = workers_of(os.getpid())
            os.kill(other, signal.SIGKILL)

    run = tmp_path / "run"
    with pytest.raises(RunError) as found:
        train(config, run, progress=kill)
    assert str(found.value) == (
        "worker 1 ended with signal SIGKILL; go on from what was saved last with: "
        f"innerattn train --resume {run}"
    )
    assert read_info(run).state == "interrupted"
    assert left_by(resume(run)) == whole("td-inner")


def begun(config: RunConfig, run: Path, tmp_path: Path) -> subprocess.Popen[str]:
    """A training in a process of its own, which has saved a checkpoint."""

    write_toml(config, tmp_path / "config.toml")
    command = [
        sys.executable,
        "-m",
        "innerattn",
        "train",
        "--config",
        str(tmp_path / "config.toml"),
    ]
    process = subprocess.Popen(
        [*command, "--run-dir", str(run)],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )
    while not (run / "checkpoints" / "latest").exists():
        assert process.poll() is None, process.communicate()
        time.sleep(0.05)
    return process


@pytest.mark.long
@pytest.mark.usefixtures("interruptible")
@pytest.mark.parametrize("sent", [signal.SIGINT, signal.SIGKILL])
def test_no_worker_outlives_the_first(
    sent: signal.Signals, small_config: Configure, tmp_path: Path
) -> None:
    long = {**SMALL, "train.method": "ppo-inner", "train.env_steps": 10_000_000}
    run = tmp_path / "run"
    with begun(small_config(**long), run, tmp_path) as process:
        (other,) = workers_of(process.pid)
        process.send_signal(sent)
        _, error = process.communicate(timeout=60)
        assert gone(other)
    if sent == signal.SIGINT:
        assert process.returncode == 130
        assert f"go on with: innerattn train --resume {run}" in error
        assert "Traceback" not in error
        assert "Warning" not in error
        assert read_info(run).state == "interrupted"
    shutil.rmtree(run)


def test_one_worker_is_a_run_as_before(small_config: Configure) -> None:
    config = small_config(**{"train.workers": 1})
    assert config.digest() == small_config().digest()
    assert config.digest() != small_config(**{"train.workers": 2}).digest()


@pytest.mark.parametrize(
    ("values", "text"),
    [
        ({"train.workers": 5}, "train.workers = 5: must divide train.num_envs = 12"),
        ({"train.workers": 3}, "train.workers = 3: must divide td.batch_size = 16"),
        ({"train.workers": 0}, "train.workers = 0"),
        (
            {"train.workers": 3, "train.method": "mappo", **WARM},
            "train.workers = 3: must divide imitation.batch_size = 32",
        ),
    ],
)
def test_shares_must_be_equal(values: dict[str, Any], text: str) -> None:
    base = {"train.num_envs": 12, "td.batch_size": 16}
    with pytest.raises(ConfigError, match=text):
        load_run_config("mixed", overrides={**base, **values})


@pytest.mark.parametrize(
    ("values", "text"),
    [
        ({"train.device": "cuda:9"}, "train.workers = 2: must be 1 where train.device = 'cuda:9'"),
        ({"train.workers": 256, "train.num_envs": 256}, "train.workers = 256: must be at most "),
    ],
)
def test_what_cannot_be_is_refused_before_a_process_starts(
    values: dict[str, Any], text: str, small_config: Configure, tmp_path: Path
) -> None:
    config = small_config(**{**SMALL, "train.method": "ppo-inner", **values})
    with pytest.raises(ConfigError, match=text):
        train(config, tmp_path / "run")
    assert not (tmp_path / "run").exists()


@pytest.mark.long
def test_what_another_worker_finds_is_told_in_one_line(
    small_config: Configure, tmp_path: Path
) -> None:
    config = small_config(**{**SMALL, **CASES["td-inner"]})
    run = tmp_path / "run"
    with pytest.raises(KeyboardInterrupt):
        train(config, run, progress=stops_after(25))
    folder = run / "checkpoints" / "rows"
    for rows in folder.glob("worker1.learner.replay-*"):
        rows.write_bytes(rows.read_bytes()[:-1])
    with pytest.raises(RunError) as found:
        resume(run)
    assert str(found.value).startswith(f"worker 1: {folder}/worker1.learner.replay-")
    assert read_info(run).state == "interrupted"
    assert not workers_of(os.getpid())
