"""A finished run, trained once by the command itself, for tests of more than one room."""

from pathlib import Path

import pytest

from innerattn.cli.main import main


@pytest.fixture(scope="session")
def tiny() -> list[str]:
    """Options of `train` for a run of a few seconds."""
    options = {
        "train.env-steps": 400,
        "train.num-envs": 8,
        "train.threads": 1,
        "train.log-every-env-steps": 100,
        "td.warmup-env-steps": 64,
        "td.batch-size": 32,
        "network.hidden-width": 16,
        "network.attention-heads": 2,
        "evaluate.episodes": 4,
        "evaluate.score-episodes": 6,
        "evaluate.long-episodes": 2,
        "evaluate.long-episode-steps": 30,
    }
    return [word for key, value in options.items() for word in (f"--{key}", str(value))]


@pytest.fixture(scope="session")
def run_dir(tmp_path_factory: pytest.TempPathFactory, tiny: list[str]) -> Path:
    """A run's folder; not to be changed."""
    path = tmp_path_factory.mktemp("runs") / "tiny"
    assert main(["train", "--run-dir", str(path), "--seed", "3", *tiny]) == 0
    return path
