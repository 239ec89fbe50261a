"""Metrics: lines of JSON, whole and finite."""

import json
import math
import resource
from pathlib import Path

import pytest

from innerattn.errors import RunError
from innerattn.train.collect import Tally
from innerattn.train.metrics import Interval, MetricsFile


def test_interval_counts_from_line_to_line() -> None:
    interval = Interval()
    interval.add_losses({})
    interval.add_losses({"critic_loss": 1.0, "q": 2.0})
    interval.add_losses({"critic_loss": 3.0, "q": 4.0})
    line = interval.close(1000, 20, Tally(4, 10, 4, 12), {"food_0": [1.0]})
    assert line["losses"] == {"critic_loss": 2.0, "q": 3.0}
    assert line["rescues_per_episode"] == 2.5
    assert line["rescues_per_env_step"] == 0.012
    assert line["attention_entropy"] == {"food_0": [1.0]}
    line = interval.close(1500, 30, Tally(0, 0, 4, 1), {})
    assert line["losses"] == {}
    assert line["rescues_per_episode"] is None
    assert line["rescues_per_env_step"] == 0.002
    assert (line["env_steps"], line["updates"], line["episodes"]) == (1500, 30, 4)
    assert not {"lost_per_env_step", "turned_away_per_env_step"} & line.keys()
    line = interval.close(2000, 30, Tally(0, 0, 4, 1, all_lost=5, all_turned_away=20), {})
    assert line["lost_per_env_step"] == 0.01
    assert line["turned_away_per_env_step"] == 0.04


def test_rates_are_of_the_interval_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [100.0]
    monkeypatch.setattr("innerattn.train.metrics.time.perf_counter", lambda: now[0])
    interval = Interval()
    now[0] = 110.0
    line = interval.close(1000, 20, Tally(0, 0, 0, 0), {})
    assert (line["seconds"], line["env_steps_per_s"], line["updates_per_s"]) == (10.0, 100.0, 2.0)
    now[0] = 115.0
    line = interval.close(4000, 30, Tally(0, 0, 0, 0), {})
    assert (line["seconds"], line["env_steps_per_s"], line["updates_per_s"]) == (15.0, 600.0, 2.0)


def test_processor_time_goes_on_after_a_stop(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [100.0]
    monkeypatch.setattr("innerattn.train.metrics.time.process_time", lambda: now[0])
    interval = Interval()
    now[0] = 103.0
    assert interval.cpu_seconds == 3.0
    state = interval.resume_state()
    now[0] = 1.0  # of another process
    other = Interval()
    other.load_resume_state(state)
    now[0] = 1.5
    assert other.cpu_seconds == 3.5
    del state["cpu_seconds"]
    other.load_resume_state(state)
    assert other.cpu_seconds is None
    assert "cpu_seconds" not in other.resume_state()


def test_lines_are_appended_whole(tmp_path: Path) -> None:
    file = MetricsFile(tmp_path / "metrics.jsonl")
    lines = [{"env_steps": n, "losses": {"critic_loss": 0.1 * n}} for n in range(3)]
    for line in lines:
        file.append(line)
    text = (tmp_path / "metrics.jsonl").read_text()
    assert text.endswith("\n")
    assert [json.loads(line) for line in text.splitlines()] == lines


@pytest.mark.parametrize(
    ("figures", "named"),
    [
        ({"losses": {"q": 1.0, "critic_loss": math.nan}}, "losses.critic_loss = nan"),
        ({"losses": {"q": -math.inf, "critic_loss": math.nan}}, "losses.q = -inf"),
        ({"attention_entropy": {"food_0": [0.5, math.inf]}}, "attention_entropy.food_0 = inf"),
    ],
)
def test_divergence_is_named(
    tmp_path: Path, figures: dict[str, dict[str, object]], named: str
) -> None:
    file = MetricsFile(tmp_path / "metrics.jsonl")
    with pytest.raises(RunError) as caught:
        file.append({"env_steps": 600, "rescues_per_episode": None, **figures})
    assert str(caught.value) == f"training diverged at env_steps = 600: {named}: must be finite"
    assert not (tmp_path / "metrics.jsonl").exists()


def test_a_line_that_does_not_fit_waits_until_there_is_space(tmp_path: Path) -> None:
    path = tmp_path / "metrics.jsonl"
    file = MetricsFile(path)
    file.append({"env_steps": 1, "losses": {}})
    before = path.read_bytes()
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (len(before) + 10, limits[1]))  # a full disk
    try:
        with pytest.raises(OSError, match="No space left on device"):
            file.append({"env_steps": 2, "losses": {}})
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert path.read_bytes() == before
    file.append({"env_steps": 3, "losses": {}})
    assert [json.loads(line)["env_steps"] for line in path.read_text().splitlines()] == [1, 2, 3]
