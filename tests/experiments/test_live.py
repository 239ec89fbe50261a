"""A training as it stands, read from its folder while it goes on."""

import json
import math
import shutil
from pathlib import Path
from typing import Any

import pytest

from innerattn.errors import RunError
from innerattn.experiments.live import MOST_POINTS, read_live


@pytest.fixture
def run(run_dir: Path, tmp_path: Path) -> Path:
    """A copy of a run, to be changed at will."""
    return Path(shutil.copytree(run_dir, tmp_path / "mine"))


def mark(run: Path, **values: Any) -> None:
    document = json.loads((run / "run.json").read_text()) | values
    (run / "run.json").write_text(json.dumps(document))


def logged(run: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in (run / "metrics.jsonl").read_text().splitlines()]


def test_a_finished_run(run: Path) -> None:
    found, lines = read_live(run), logged(run)
    assert (found.name, found.method, found.situation, found.seed) == (
        "mine",
        "td-inner",
        "mixed",
        3,
    )
    assert (found.state, found.env_steps, found.total_env_steps) == ("done", 400, 400)
    assert found.checkpoint == 400
    assert found.seconds_left is None
    assert found.times == tuple(line["env_steps"] for line in lines)
    assert found.rescues == tuple(line["rescues_per_episode"] for line in lines)
    values = [v for heads in lines[-1]["attention_entropy"].values() for v in heads]
    assert found.entropy[-1] == pytest.approx(sum(values) / len(values))
    assert found.even_nats == pytest.approx(math.log(3))


def test_a_run_half_way(run: Path) -> None:
    lines = logged(run)[:2]
    lines[1]["env_steps_per_s"] = 50.0
    (run / "metrics.jsonl").write_text("".join(f"{json.dumps(line)}\n" for line in lines))
    mark(run, state="running", sealed=False, env_steps=lines[1]["env_steps"])
    shutil.rmtree(run / "checkpoints")
    found = read_live(run)
    assert found.checkpoint is None
    assert found.seconds_left == pytest.approx((400 - lines[1]["env_steps"]) / 50.0)
    assert found.silent_s is not None
    assert 0.0 <= found.silent_s < 60.0


def test_a_run_that_has_logged_nothing(run: Path) -> None:
    (run / "metrics.jsonl").unlink()
    mark(run, state="running", sealed=False, env_steps=0)
    found = read_live(run)
    assert (found.env_steps, found.times, found.entropy, found.silent_s) == (0, (), (), None)


def test_long_courses_are_thinned_and_keep_the_newest_point(run: Path) -> None:
    line = logged(run)[0]
    many = [json.dumps({**line, "env_steps": step}) for step in range(1, 3 * MOST_POINTS)]
    (run / "metrics.jsonl").write_text("\n".join(many) + "\n")
    found = read_live(run)
    assert len(found.times) == MOST_POINTS == len(found.rescues) == len(found.entropy)
    assert found.times[-1] == 3 * MOST_POINTS - 1
    assert list(found.times) == sorted(found.times)


@pytest.mark.parametrize("text", ["{", "[]\n", '{"env_steps": 1}\n'])
def test_damaged_metrics_are_refused(run: Path, text: str) -> None:
    (run / "metrics.jsonl").write_text(text)
    with pytest.raises(RunError, match=r"metrics\.jsonl: not the metrics of a run"):
        read_live(run)
