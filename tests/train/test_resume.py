"""A training that is cut and goes on in another process is the training that was not cut."""

import hashlib
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import hypothesis.strategies as st
import pytest
from hypothesis import HealthCheck, given, settings
from once import made_once

from innerattn.config import RunConfig
from innerattn.errors import RunError
from innerattn.records.run_folder import newest_weights, read_info
from innerattn.train import NothingToResumeError, Progress, resume, train
from innerattn.train.weights import digest_of

Configure = Callable[..., RunConfig]

SMALL = {
    "train.env_steps": 480,
    "train.checkpoint_every_env_steps": 0,
    "train.checkpoint_every_minutes": 0.0,
    "ppo.rollout_steps": 7,
    "ppo.minibatch_size": 32,
    "ppo.epochs": 2,
    "network.attention_heads": 2,
    "td.replay_capacity": 300,
    "td.update_every_env_steps": 20,
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
SCHEDULE = {
    "train.schedule": {
        "dense_weight": {"first": 1.0, "last": 0.0},
        "team_credit": {"first": 0.0, "last": 1.0},
        "gamma": {"first": 0.9, "last": 0.98},
        "entropy_weight": {"first": 0.02, "last": 0.01},
    }
}
POTENTIAL = {"train.potential": "hungarian", "train.potential_env_steps": 1000}
FAULTS = {
    "scenario.faults": [
        {"kind": kind, "robot": "food_0", "onset_step": 3, "duration_steps": 9, "value": value}
        for kind, value in (("position_noise", 0.2), ("frozen_sensor", 0.5))
    ]
}
MEMORY = {"ppo.sequence_steps": 7}
ARRIVALS = {"ppo.bootstrap": "afterstate", "scenario.rescue_radius_m": 0.9}
ALIKE = (
    "td-uniform",
    "ppo-uniform",
    "mappo schedule",
    "mappo potential",
    "mappo augmented",
)
"""Cases whose state is that of others: all are drawn from, and each is cut by `make test-slow`."""
METHODS = ("td-inner", "td-uniform", "ppo-inner", "ppo-uniform", "mappo")
CASES: dict[str, dict[str, Any]] = {
    **{method: {"train.method": method} for method in METHODS},
    **{
        f"{method} {name}": {"train.method": method, **values}
        for method in ("td-inner", "ppo-inner", "mappo")
        for name, values in (
            ("warm start", WARM),
            ("schedule", SCHEDULE),
            ("potential", POTENTIAL),
            ("canonical", {"network.symmetry": "canonical"}),
            ("augmented", {"network.symmetry": "augmented", "train.stagger_starts": True}),
        )
    },
    "td-inner faults": {"train.method": "td-inner", **FAULTS},
    "ppo-inner faults": {"train.method": "ppo-inner", **FAULTS},
    "ppo-inner continuous": {"train.method": "ppo-inner", "scenario.actions": "continuous"},
    "mappo continuous canonical": {
        "train.method": "mappo",
        "scenario.actions": "continuous",
        "network.symmetry": "canonical",
        **POTENTIAL,
    },
    "ppo-inner afterstates": {"train.method": "ppo-inner", **ARRIVALS},
    "mappo afterstates canonical": {
        "train.method": "mappo",
        "network.symmetry": "canonical",
        **ARRIVALS,
    },
    "ppo-inner memory": {"train.method": "ppo-inner", "network.memory_width": 8, **MEMORY},
    "mappo memory canonical": {
        "train.method": "mappo",
        "network.memory_width": 4,
        "network.symmetry": "canonical",
        "network.parameter_sharing": "kind",
        **MEMORY,
    },
    "ppo-inner messages": {
        "train.method": "ppo-inner",
        "network.message_width": 8,
        "scenario.communication": {"range_m": 1.2, "loss": 0.1},
    },
    "mappo messages memory canonical": {
        "train.method": "mappo",
        "network.message_width": 4,
        "network.message_pooling": "nearest",
        "network.memory_width": 4,
        "network.symmetry": "canonical",
        "network.parameter_sharing": "kind",
        "scenario.communication": {"delay_steps": 2},
        **MEMORY,
    },
    "ppo-uniform messages augmented": {
        "train.method": "ppo-uniform",
        "network.message_width": 8,
        "network.message_pooling": "max",
        "network.symmetry": "augmented",
        "train.stagger_starts": True,
        "scenario.communication": {"delay_steps": 1},
    },
    "ppo-inner entities": {
        "train.method": "ppo-inner",
        "network.encoder": "entities",
        "network.pooling": "nearest",
        "network.message_width": 8,
        "network.memory_width": 4,
        **MEMORY,
    },
    "two threads": {"train.method": "td-inner", "train.threads": 2},
}
LONG = (
    "two threads",
    *(
        f"{method} {name}"
        for method in ("td-inner", "mappo")
        for name in ("warm start", "schedule", "potential", "canonical", "augmented")
        if f"{method} {name}" not in ALIKE
    ),
)
"""Cases of which there is another one with `ppo-inner`; `make test-long` cuts them."""


def left_by(run: Path) -> tuple[str, str]:
    """Digests of the weights and of all that the metrics say but for the time."""
    lines = [json.loads(line) for line in (run / "metrics.jsonl").read_text().splitlines()]
    for line in lines:
        for name in ("seconds", "env_steps_per_s", "updates_per_s"):
            del line[name]
    text = json.dumps(lines)
    return digest_of(newest_weights(run)), hashlib.sha256(text.encode()).hexdigest()


def stopped_after(steps: int) -> Callable[[Progress], None]:
    """Stops a training after so many of its control steps."""
    seen = 0

    def progress(_: Progress) -> None:
        nonlocal seen
        seen += 1
        if seen == steps:
            raise KeyboardInterrupt

    return progress


def elsewhere(run: Path, stop_after: int = 0) -> None:
    """Go on with a run in a new process."""
    code = """
import sys
from pathlib import Path
sys.path[:0] = sys.argv[3:]
from test_resume import stopped_after
from innerattn.train import resume
try:
    resume(Path(sys.argv[1]), progress=stopped_after(int(sys.argv[2])))
except KeyboardInterrupt:
    assert int(sys.argv[2])
"""
    here = Path(__file__).parent
    folders = [str(here), str(here.parent / "support")]
    command = [sys.executable, "-c", code, str(run), str(stop_after), *folders]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.fixture(scope="session")
def whole(
    small_config: Configure, tmp_path_factory: pytest.TempPathFactory
) -> Callable[[str], tuple[str, str]]:
    """What a case leaves that is not cut, by its name."""

    def of(case: str) -> tuple[str, str]:
        def make(folder: Path) -> None:
            train(small_config(**{**SMALL, **CASES[case]}), folder / "run")

        return left_by(made_once(tmp_path_factory, f"whole {case}", make) / "run")

    return of


@pytest.mark.parametrize(
    "case",
    [
        *(one for one in CASES if one not in (*ALIKE, *LONG)),
        *(pytest.param(one, marks=pytest.mark.long) for one in LONG),
        *(pytest.param(one, marks=pytest.mark.slow) for one in ALIKE),
    ],
)
def test_a_run_that_was_cut_is_the_run_that_was_not(
    small_config: Configure,
    whole: Callable[[str], tuple[str, str]],
    tmp_path: Path,
    case: str,
) -> None:
    run = tmp_path / "run"
    # The middle of the imitation, where there is one, or before the memory is full; then later.
    with pytest.raises(KeyboardInterrupt):
        train(small_config(**{**SMALL, **CASES[case]}), run, progress=stopped_after(17))
    first = read_info(run)
    assert first.state == "interrupted"
    with pytest.raises(KeyboardInterrupt):
        resume(run, progress=stopped_after(16))
    second = read_info(run)
    assert second.env_steps == 33 * 12
    resume(run)
    assert left_by(run) == whole(case)
    info = read_info(run)
    assert (info.state, info.resumed) == ("done", 2)
    times = [one.cpu_seconds or 0.0 for one in (first, second, info)]
    assert 0.0 < times[0] < times[1] < times[2], "what was spent before a stop counts"
    with pytest.raises(NothingToResumeError, match="is done"):
        resume(run)


@pytest.mark.long
@pytest.mark.parametrize("case", ["td-inner warm start", "ppo-inner schedule"])
def test_a_new_process_goes_on_alike(
    small_config: Configure,
    whole: Callable[[str], tuple[str, str]],
    tmp_path: Path,
    case: str,
) -> None:
    run = tmp_path / "run"
    with pytest.raises(KeyboardInterrupt):
        train(small_config(**{**SMALL, **CASES[case]}), run, progress=stopped_after(9))
    elsewhere(run, stop_after=8)
    elsewhere(run)
    assert left_by(run) == whole(case)


@settings(max_examples=6, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    case=st.sampled_from(sorted(CASES)),
    cuts=st.lists(st.integers(1, 20), min_size=1, max_size=4),
)
def test_wherever_it_is_cut(
    small_config: Configure,
    whole: Callable[[str], tuple[str, str]],
    tmp_path_factory: pytest.TempPathFactory,
    case: str,
    cuts: list[int],
) -> None:
    run = tmp_path_factory.mktemp("cut") / "run"
    config = small_config(**{**SMALL, **CASES[case]})
    for number, steps in enumerate(cuts):
        try:
            if number == 0:
                train(config, run, progress=stopped_after(steps))
            else:
                resume(run, progress=stopped_after(steps))
        except KeyboardInterrupt:
            continue
        break
    if read_info(run).state != "done":
        resume(run)
    assert left_by(run) == whole(case)


@pytest.mark.parametrize("case", ["td-inner", "mappo warm start", "ppo-inner potential"])
def test_one_that_was_killed_before_its_first_checkpoint_begins_anew(
    small_config: Configure, tmp_path: Path, case: str
) -> None:
    run, killed, planted = tmp_path / "run", tmp_path / "killed", tmp_path / "planted"
    logs = {"train.log_every_env_steps": 60}

    def copy(now: Progress) -> None:
        if now.env_steps == 240 and not killed.exists():  # of the first stage
            shutil.copytree(run, killed)  # what a kill leaves

    train(small_config(**{**SMALL, **CASES[case], **logs}), run, progress=copy)
    assert (killed / "metrics.jsonl").exists()
    (killed / "checkpoints" / ".48.0123456789abcdef").mkdir()
    planted.mkdir()
    (killed / "checkpoints" / "rows").mkdir(exist_ok=True)
    (killed / "checkpoints" / "link").symlink_to(planted)
    said = r"and is in training or was killed; go on with: innerattn train --resume"
    with pytest.raises(RunError, match=said):
        train(small_config(), killed)
    resume(killed)
    assert left_by(killed) == left_by(run)
    assert (read_info(killed).state, read_info(killed).resumed) == ("done", 1)
    found = [{path.relative_to(one).as_posix() for path in one.rglob("*")} for one in (run, killed)]
    assert found[0] == found[1]
    assert planted.exists()


@pytest.mark.long
@pytest.mark.parametrize("case", ["td-inner", "ppo-inner", "mappo warm start"])
def test_checkpoints_at_every_step_change_nothing(
    small_config: Configure,
    whole: Callable[[str], tuple[str, str]],
    tmp_path: Path,
    case: str,
) -> None:
    often = {"train.checkpoint_every_env_steps": 12, "train.keep_checkpoints": 3}
    run = train(small_config(**{**SMALL, **CASES[case], **often}), tmp_path / "run")
    assert left_by(run) == whole(case)
    kept = {path.name for path in (run / "checkpoints").iterdir()}
    best = {name for name in kept if name.startswith("best-")}
    last = str(read_info(run).env_steps)
    assert kept - best == {last, "latest"}
    assert len(best) == 1
    assert os.listdir(run / "checkpoints" / last) == ["weights.safetensors"]
