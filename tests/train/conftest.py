import os
from collections.abc import Callable
from pathlib import Path

import pytest
from once import made_once

from innerattn.config import RunConfig, load_run_config
from innerattn.train import train


def small_config(**values: object) -> RunConfig:
    """A run of 600 env-steps in 12 worlds, a few seconds long at most.

    `make test-gpu` sets the device.
    """
    small = {
        "train.env_steps": 600,
        "train.num_envs": 12,
        "train.threads": 1,
        "train.device": os.environ.get("INNERATTN_TEST_DEVICE", "cpu"),
        "train.log_every_env_steps": 200,
        "td.warmup_env_steps": 200,
        "td.batch_size": 16,
        "network.hidden_width": 16,
    }
    return load_run_config("mixed", overrides={**small, **values})


@pytest.fixture(scope="session", name="small_config")
def small_config_fixture() -> Callable[..., RunConfig]:
    return small_config


@pytest.fixture(scope="session")
def finished_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run that went to its end; tests must not change it."""

    def make(folder: Path) -> None:
        train(small_config(), folder / "run")

    return made_once(tmp_path_factory, "finished_run", make) / "run"
