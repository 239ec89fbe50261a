"""Training in worlds where victims arrive at random, so that often nobody is there."""

import json
import math
from collections.abc import Callable
from pathlib import Path

import pytest
from safetensors.torch import load_file

from innerattn.config import RunConfig
from innerattn.records.run_folder import read_info
from innerattn.train import train

TASKS = [
    {"name": "task_1", "needs": ("food", "medicine"), "arrival_rate_hz": 0.3},
    {"name": "task_2", "needs": ("food", "information"), "arrival_rate_hz": 0.2},
]


@pytest.mark.parametrize("method", ["td-inner", "ppo-inner"])
@pytest.mark.parametrize("encoder", ["flat", "entities"])
def test_a_run_ends_with_numbers(
    method: str, encoder: str, tmp_path: Path, small_config: Callable[..., RunConfig]
) -> None:
    worlds = {"situation": "poisson", "tasks": TASKS, "rescue_radius_m": 0.5}
    changes = {f"scenario.{key}": value for key, value in worlds.items()}
    config = small_config(**changes, **{"train.method": method, "network.encoder": encoder})
    train(config, tmp_path / "run")
    assert read_info(tmp_path / "run").state == "done"
    lines = [json.loads(line) for line in (tmp_path / "run/metrics.jsonl").read_text().splitlines()]
    assert all(math.isfinite(loss) for line in lines for loss in line["losses"].values())
    assert sum(line["rescues_per_env_step"] for line in lines) > 0
    (weights,) = (tmp_path / "run/checkpoints").glob("*/weights.safetensors")
    assert all(tensor.isfinite().all() for tensor in load_file(weights).values())
