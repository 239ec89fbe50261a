"""A memory that is larger than what is free is refused before anything is learnt."""

from collections.abc import Callable
from pathlib import Path

import pytest

from innerattn.config import RunConfig
from innerattn.evaluate import evaluate_run
from innerattn.train import train
from innerattn.train.memory import free_bytes

Configure = Callable[..., RunConfig]


def test_free_memory_is_what_the_system_says(tmp_path: Path) -> None:
    account = tmp_path / "meminfo"
    account.write_text("MemTotal:  24683008 kB\nMemFree: 5 kB\nMemAvailable:   7 kB\n")
    assert free_bytes(account) == 7 * 1024
    account.write_text("MemTotal:  24683008 kB\n")
    assert free_bytes(account) is None
    assert free_bytes(tmp_path / "none") is None


@pytest.mark.parametrize(
    ("values", "told"),
    [
        ({}, r"^td\.replay_capacity = 200000: takes 0\.0 GiB; 0\.0 GiB are free$"),
        (
            {
                "train.warm_start": "hungarian",
                "imitation.env_steps": 9000,
                "imitation.memory_env_steps": 9000,
                "td.replay_capacity": 256,
            },
            r"^imitation\.memory_env_steps = 9000: takes ",
        ),
    ],
)
def test_it_is_named_and_leaves_no_run(
    small_config: Configure,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    values: dict[str, object],
    told: str,
) -> None:
    monkeypatch.setattr("innerattn.train.memory.free_bytes", lambda: 10_000)
    with pytest.raises(MemoryError, match=told):
        train(small_config(**values), tmp_path / "run")
    assert not (tmp_path / "run").exists()


@pytest.mark.long
def test_only_what_the_run_fills_counts_and_measuring_needs_none(
    small_config: Configure, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    config = small_config(**{"td.replay_capacity": 1_000_000})
    monkeypatch.setattr("innerattn.train.memory.free_bytes", lambda: 20_000_000)
    run = train(config, tmp_path / "run")
    monkeypatch.setattr("innerattn.train.memory.free_bytes", lambda: 0)
    monkeypatch.setattr("innerattn.learn.td.Replay", None)
    assert evaluate_run(run).summary.standard.episodes > 0
