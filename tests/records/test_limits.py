"""Records that would take all memory, or say what no play leaves behind, are refused."""

import json
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from innerattn.config import Scenario
from innerattn.errors import RunError
from innerattn.evaluate.play import run_episodes
from innerattn.policies import PolicyInput, scripted_policy
from innerattn.records import read_records, write_records

FORMAT = b"innerattn.records"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    scenario = Scenario.preset("mixed")
    fields = ("obs", "actions", "victims")
    record = run_episodes(scripted_policy("greedy", scenario, 0), scenario, 6, 0, record=fields)
    assert len(record.rescues) > 3
    write_records([record], tmp_path)
    read_records(tmp_path)
    return tmp_path


Head = dict[str, Any]


def forge(
    file: Path,
    head: Callable[[Head], object] = lambda _: None,
    columns: Callable[[dict[str, Any]], object] = lambda _: None,
) -> None:
    """Write a table anew with another head or other columns."""
    table = pq.read_table(file)
    described = json.loads(table.schema.metadata[FORMAT])
    head(described)
    parts = {name: table[name] for name in table.column_names}
    columns(parts)
    changed = pa.table(parts).replace_schema_metadata({FORMAT: json.dumps(described)})
    pq.write_table(changed, file, compression="zstd")


def both(folder: Path, head: Callable[[Head], object]) -> None:
    for name in ("episodes.parquet", "rescues.parquet"):
        forge(folder / name, head)


def obs(head: Head) -> Head:
    found: Head = head["records"][0]["steps"]["obs"]
    return found


HEADS: dict[str, Callable[[Head], object]] = {
    "a shape of 596 GiB": lambda head: obs(head).update(shape=[25, 4, 10**9]),
    "a shape past all numbers": lambda head: obs(head).update(shape=[25, 2**62, 2**62]),
    "a negative size": lambda head: obs(head).update(shape=[25, -1, 4]),
    "a size of text": lambda head: obs(head).update(shape=["25"]),
    "another length": lambda head: obs(head).update(shape=[100, 1, 54]),
    "fields of 596 GiB": lambda head: head["records"][0]["steps"]["victims"].update(
        shape=[25, 2, 10**9]
    ),
    "a dtype of objects": lambda head: obs(head).update(dtype="O"),
    "a dtype of text": lambda head: obs(head).update(dtype="U100000000"),
    "a dtype of many": lambda head: obs(head).update(dtype="(1000000,1000000)f8"),
    "fields of objects": lambda head: obs(head).update(dtype=[["x", "O"]]),
    "a seed of text": lambda head: head["records"][0].update(seed="0"),
    "a negative seed": lambda head: head["records"][0].update(seed=-1),
    "other robots": lambda head: head["records"][0].update(robot_names=["a", "b", "c", "d"]),
    "no scenario": lambda head: head["records"][0].pop("scenario"),
    "a broken scenario": lambda head: head["records"][0]["scenario"].update(dt_s=-1),
    "no records": lambda head: head.update(records=None),
    "records of text": lambda head: head.update(records=["x"]),
    "deep": lambda head: head.update(deep=json.loads(80 * "[" + 80 * "]")),
}


@pytest.mark.parametrize("what", HEADS)
def test_what_a_file_says_of_itself_is_checked(folder: Path, what: str) -> None:
    both(folder, HEADS[what])
    with pytest.raises(RunError, match=str(folder)):
        read_records(folder)


def column(name: str, values: Callable[[np.ndarray], Any]) -> Callable[[dict[str, Any]], object]:
    def change(parts: dict[str, Any]) -> None:
        parts[name] = pa.array(values(parts[name].to_numpy().copy()))

    return change


def at(place: int, value: int) -> Callable[[np.ndarray], Any]:
    def change(values: np.ndarray) -> np.ndarray:
        values[place] = value
        return values

    return change


COLUMNS: dict[str, tuple[str, Callable[[dict[str, Any]], object]]] = {
    "no step": ("episodes", column("steps", at(0, 0))),
    "too many steps": ("episodes", column("steps", at(1, 26))),
    "a rescue in a far episode": ("rescues", column("episode", at(0, 2**40))),
    "a rescue before all": ("rescues", column("episode", at(0, -1))),
    "a rescue after the end": ("rescues", column("step", at(0, 25))),
    "a rescue at a negative step": ("rescues", column("step", at(0, -1))),
    "a slot too far": ("rescues", column("slot", at(0, 2))),
    "a negative victim": ("rescues", column("victim", at(0, -1))),
    "more rescues": ("episodes", column("rescues", at(2, 1000))),
    "a task of nobody": ("rescues", column("task", lambda x: ["task_9"] * len(x))),
    "a helper of nobody": ("rescues", column("helper_0", lambda x: ["food_9"] * len(x))),
}


@pytest.mark.parametrize("what", COLUMNS)
def test_numbers_that_no_play_leaves_behind_are_refused(folder: Path, what: str) -> None:
    file, change = COLUMNS[what]
    forge(folder / f"{file}.parquet", columns=change)
    with pytest.raises(RunError, match="records do not fit their description"):
        read_records(folder)


IN_A_STEP: dict[str, tuple[str, str, Any, str]] = {
    "observation of nothing": ("greedy", "obs", np.nan, "obs: must be finite"),
    "observation without end": ("greedy", "obs", np.inf, "obs: must be finite"),
    "observation far off": ("greedy", "obs", 1e30, "obs: must be in -1e"),
    "place far off": ("greedy", "positions", 1e30, "positions: must be in -1..=1"),
    "place outside": ("greedy", "positions", -1.01, "positions: must be in -1..=1"),
    "speed": ("greedy", "velocities", 1e5, "velocities: must be in -10000..=10000"),
    "reward": ("greedy", "rewards", 1e30, "rewards: must be in -1e"),
    "action": ("greedy", "actions", 5, "actions: must be in 0..=4"),
    "attention": ("attentive", "attention", 1.5, "attention: must be in "),
    "attention of actors": ("attentive", "actor_attention", -0.1, "actor_attention: must be in "),
    "task": ("greedy", "victims", ("task", 2), "task of a victim: must be in 0..=1"),
    "place of a victim": ("greedy", "victims", ("x", 1e30), "x of a victim: must be in -1..=1"),
    "time of a victim": ("greedy", "victims", ("appeared_step", 26), "appeared_step of a victim"),
    "fault": ("greedy", "faults", ("motor_gain", -1e30), "fault motor_gain: must be in "),
}


class EvenAttention:
    """A script that looks at all teammates alike."""

    name, needs_true_state = "attentive", True

    def __init__(self, scenario: Scenario) -> None:
        self._script = scripted_policy("greedy", scenario, 0)

    def reset(self, seed: int) -> None:
        self._script.reset(seed)

    def act(self, view: PolicyInput) -> np.ndarray:
        return np.asarray(self._script.act(view))

    def attention(self, view: PolicyInput, actions: np.ndarray) -> np.ndarray:
        assert len(actions) == len(view.obs)
        even = (1 - np.eye(4, dtype=np.float32)) / 3
        return np.broadcast_to(even, (len(actions), 1, 4, 4))

    def actor_attention(self, view: PolicyInput) -> np.ndarray:
        return self.attention(view, np.zeros(len(view.obs)))


@pytest.mark.parametrize("what", IN_A_STEP)
def test_no_step_holds_what_worlds_cannot(tmp_path: Path, what: str) -> None:
    policy_name, name, bad, message = IN_A_STEP[what]
    scenario = Scenario.preset("mixed")
    attentive = policy_name == "attentive"
    policy = EvenAttention(scenario) if attentive else scripted_policy("greedy", scenario, 0)
    record = run_episodes(policy, scenario, 2, 0, record=[name])
    write_records([record], tmp_path)
    read_records(tmp_path)
    values = record.steps[name].copy()
    if isinstance(bad, tuple):
        values[bad[0]].flat[0] = bad[1]
    else:
        values.flat[0] = bad
    write_records([replace(record, steps={name: values})], tmp_path)
    with pytest.raises(RunError, match=message):
        read_records(tmp_path)


BOMB = """
import resource, sys
from pathlib import Path
from innerattn.errors import RunError
from innerattn.records import read_records

folder = Path(sys.argv[1])
try:
    read_records(folder)
except RunError:
    pass
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
Path(sys.argv[2]).rename(folder / "episodes.parquet")
try:
    read_records(folder)
except RunError as error:
    print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before, error)
"""


@pytest.mark.long
@pytest.mark.parametrize("rows", [20_000_000, 200_000_000])
def test_a_table_that_unpacks_to_far_more_than_its_file_is_refused(
    folder: Path, tmp_path: Path, rows: int
) -> None:
    head = pq.read_schema(folder / "episodes.parquet").metadata
    bomb = tmp_path / "bomb.parquet"
    schema = pa.schema({"reward": pa.float64()}).with_metadata(head)
    zeros = pa.table({"reward": np.zeros(2_000_000)}, schema=schema)
    with pq.ParquetWriter(bomb, schema, compression="zstd") as writer:
        for _ in range(rows // 2_000_000):
            writer.write_table(zeros)
    assert bomb.stat().st_size < 2**20
    command = [sys.executable, "-c", BOMB, str(folder), str(bomb)]
    ran = subprocess.run(command, capture_output=True, text=True, timeout=60, check=True)
    grown, _, text = ran.stdout.partition(" ")
    assert "bytes unpack to" in text
    assert int(grown) < 50_000  # KiB


def test_what_is_written_is_read_however_much_it_repeats(tmp_path: Path) -> None:
    """Long episodes that end at once: what is kept after their ends is zeros."""
    scenario = Scenario(episode_steps=1000, end_when_rescued=1, rescue_radius_m=2.0)
    fields = ("obs", "faults", "positions", "velocities", "victims", "rewards")
    policy = scripted_policy("greedy", scenario, 0)
    write_records([run_episodes(policy, scenario, 60, 0, record=fields)], tmp_path)
    assert (tmp_path / "episodes.parquet").stat().st_size > 2**25  # it is not packed
    (record,) = read_records(tmp_path)
    assert record.steps["obs"].shape[:2] == (60, 1000)
