"""A training sends each line of its metrics to the real libraries, without a network."""

import importlib
import json
import os
import sqlite3
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from innerattn.cli.main import main
from innerattn.config.untrusted import parse_json
from innerattn.loggers import LOGGERS
from innerattn.loggers.logger import values_of
from innerattn.records.run_files import RunFiles

REQUIRED = "INNERATTN_LOGGERS_REQUIRED"
Course = dict[str, list[tuple[int, float]]]
"""By name, env-steps and value of each time."""


def of_tensorboard(run: Path, _: Path) -> Course:
    from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

    found = EventAccumulator(str(run / "tensorboard"))
    found.Reload()
    (text,) = found.Tensors("parameters/text_summary")
    assert b"train.seed = 4" in text.tensor_proto.string_val[0]
    names = found.Tags()["scalars"]
    return {name: [(one.step, one.value) for one in found.Scalars(name)] for name in names}


def of_wandb(_: Path, place: Path) -> Course:
    from wandb.proto.wandb_internal_pb2 import Record

    (file,) = place.glob("wandb/offline-run-*/*.wandb")
    course: Course = {}
    for data in log_records(file.read_bytes()):
        record = Record()
        record.ParseFromString(data)
        items = record.history.item
        line = {"/".join(i.nested_key) or i.key: json.loads(i.value_json) for i in items}
        for name, value in line.items():
            if name != "env_steps" and not name.startswith("_"):
                course.setdefault(name, []).append((line["env_steps"], value))
    return course


def log_records(data: bytes) -> Iterator[bytes]:
    """The records of a LevelDB log, in blocks of 32 kB, the first with a header of 7 bytes."""
    at, record = 7, b""
    while at < len(data):
        left = 32_768 - at % 32_768
        if left < 7:
            at += left
            continue
        length, kind = int.from_bytes(data[at + 4 : at + 6], "little"), data[at + 6]
        record += data[at + 7 : at + 7 + length]
        at += 7 + length
        if kind in (1, 4):  # whole, or the last part
            yield record
            record = b""


def of_mlflow(_: Path, place: Path) -> Course:
    from mlflow import MlflowClient

    client = MlflowClient()
    experiment = client.get_experiment_by_name("innerattn")
    assert experiment is not None
    (run,) = client.search_runs([experiment.experiment_id])
    assert (run.info.status, run.data.params["train.seed"]) == ("FINISHED", "4")
    assert (run.info.run_name, place.is_dir()) == ("run", True)
    return {
        name: [(one.step, one.value) for one in client.get_metric_history(run.info.run_id, name)]
        for name in run.data.metrics
    }


def of_trackio(_: Path, place: Path) -> Course:
    with sqlite3.connect(place / "trackio" / "innerattn.db") as database:
        rows = database.execute("SELECT step, metrics FROM metrics ORDER BY step").fetchall()
    database.close()
    course: Course = {}
    for step, text in rows:
        for name, value in json.loads(text).items():
            course.setdefault(name, []).append((step, value))
    return course


READ: dict[str, Callable[[Path, Path], Course]] = {
    "tensorboard": of_tensorboard,
    "wandb": of_wandb,
    "mlflow": of_mlflow,
    "trackio": of_trackio,
}


@pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::FutureWarning")
@pytest.mark.filterwarnings("ignore::ResourceWarning")
@pytest.mark.parametrize("name", LOGGERS)
def test_each_line_of_metrics_arrives(
    name: str, tiny: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("WANDB_MODE", "offline")
    monkeypatch.setenv("WANDB_DIR", str(tmp_path))
    monkeypatch.setenv("MLFLOW_TRACKING_URI", (tmp_path / "mlflow").as_uri())
    monkeypatch.setenv("MLFLOW_ALLOW_FILE_STORE", "true")
    monkeypatch.setenv("TRACKIO_DIR", str(tmp_path / "trackio"))  # read when it is imported
    try:
        importlib.import_module(LOGGERS[name][1])
    except ImportError:
        if os.environ.get(REQUIRED):
            pytest.fail(f"{REQUIRED} is set, and {name} is not installed")
        pytest.skip(f"{name} is not installed")
    (tmp_path / "mlflow").mkdir()
    run = tmp_path / "run"
    assert main(["train", "--run-dir", str(run), "--seed", "4", "--log", name, *tiny]) == 0
    expected: Course = {}
    for line in map(parse_json, (run / "metrics.jsonl").read_text().splitlines()):
        for key, value in values_of(line).items():
            if key != "env_steps":
                expected.setdefault(key, []).append((line["env_steps"], pytest.approx(value)))
    found = READ[name](run, tmp_path)
    scores = {key: found.pop(key) for key in list(found) if key.startswith("evaluation/")}
    assert found == expected
    summary: Any = json.loads((run / "evaluation" / "summary.json").read_text())
    for length, part in (("standard", summary), ("long", summary["long"])):
        mean = part["rescues_per_episode"]["mean"]
        ((step, value),) = scores[f"evaluation/{length}/rescues_per_episode"]
        assert (step, value) == (max(expected["seconds"])[0], pytest.approx(mean))
    files = RunFiles(run)
    for file in (run / "tensorboard").glob("*"):
        files.read(f"tensorboard/{file.name}", 1 << 20)
