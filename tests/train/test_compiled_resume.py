"""A training with compiled updates that is cut goes on in another process as if it had not been."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from innerattn.config import load_run_config, write_toml
from innerattn.records.run_folder import newest_weights, read_info
from innerattn.train.weights import digest_of

SHORT = {
    "train.compile": "on",
    "train.threads": 1,
    "train.num_envs": 64,
    "train.log_every_env_steps": 320,
    "train.checkpoint_every_env_steps": 0,
    "train.checkpoint_every_minutes": 0.0,
}
CASES = {
    "ppo-inner": {
        **SHORT,
        "train.env_steps": 3200,
        "ppo.rollout_steps": 10,
        "ppo.minibatch_size": 160,
    },
    "td-inner": {
        **SHORT,
        "train.env_steps": 1280,
        "td.replay_capacity": 1000,
        "td.warmup_env_steps": 256,
        "td.batch_size": 64,
        "td.update_every_env_steps": 16,
    },
}
"""The budget `fast`, made short; each cut falls between the updates of one rollout, or later."""
CHILD = """
import sys
from innerattn.config import read_toml
from innerattn.learn.actor_critic import ActorCritic
from innerattn.train import resume, train

config, run, stop_after = sys.argv[1], sys.argv[2], int(sys.argv[3])
original, updates = ActorCritic._do_update, 0

def counted(self, *rest):
    global updates
    if updates == stop_after:
        raise KeyboardInterrupt
    updates += 1
    return original(self, *rest)

if stop_after:
    ActorCritic._do_update = counted
try:
    train(read_toml(config), run) if config else resume(run)
except KeyboardInterrupt:
    assert stop_after
"""


def in_a_new_process(run: Path, config: Path | None, stop_after: int = 0) -> None:
    """Begin a run, or go on with it, up to so many updates."""
    command = [sys.executable, "-c", CHILD, str(config or ""), str(run), str(stop_after)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "differ in the last bits" not in done.stderr
    assert read_info(run).compiled  # else there is no compiler, and nothing is shown here


def left_by(run: Path) -> tuple[str, list[object]]:
    lines = [json.loads(line) for line in (run / "metrics.jsonl").read_text().splitlines()]
    kept = [(line["env_steps"], line["updates"], line["losses"]) for line in lines]
    return digest_of(newest_weights(run)), kept


@pytest.mark.slow
@pytest.mark.parametrize("method", CASES)
def test_a_compiled_run_that_was_cut_is_the_run_that_was_not(method: str, tmp_path: Path) -> None:
    config = tmp_path / "config.toml"
    write_toml(load_run_config("mixed", method, "fast", overrides=CASES[method]), config)
    whole, run = tmp_path / "whole", tmp_path / "run"
    in_a_new_process(whole, config)
    in_a_new_process(run, config, stop_after=5)  # of the 8 of a rollout, by PPO
    assert read_info(run).state == "interrupted"
    in_a_new_process(run, None, stop_after=9)
    assert read_info(run).state == "interrupted"
    assert 0 < read_info(run).updates < read_info(whole).updates
    in_a_new_process(run, None)
    assert (read_info(run).state, read_info(run).resumed) == ("done", 2)
    assert left_by(run) == left_by(whole)
