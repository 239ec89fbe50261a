"""Parquet files hold records whole, alike for anyone who reads them, or are refused."""

from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from innerattn.config import Scenario
from innerattn.errors import RunError
from innerattn.evaluate.play import run_episodes
from innerattn.policies import scripted_policy
from innerattn.records.parquet import FORMAT, read_records, write_records
from innerattn.records.record import FIELDS, Record


@pytest.fixture(scope="module")
def records() -> list[Record]:
    worlds = Scenario.preset("double").replace(episode_steps=14)
    first = run_episodes(scripted_policy("hungarian", worlds), worlds, 5, 2, record=FIELDS)
    weights = np.random.default_rng(0).random((5, 14, 2, 4, 4), np.float32)
    first = replace(first, steps={**first.steps, "attention": weights})
    long = worlds.replace(episode_steps=30)
    ended = long.replace(end_when_rescued=1)
    return [
        first,
        run_episodes(scripted_policy("greedy", worlds), worlds, 7, 2, first_episode=5),
        run_episodes(scripted_policy("random", long), long, 3, 2, record=("actions",)),
        run_episodes(scripted_policy("hungarian", ended), ended, 3, 2, record=("positions",)),
    ]


def assert_equal(one: Record, other: Record) -> None:
    for field in fields(Record):
        a, b = getattr(one, field.name), getattr(other, field.name)
        if field.name == "steps":
            assert list(a) == list(b)
            for name in a:
                np.testing.assert_array_equal(a[name], b[name], strict=True)
        elif isinstance(a, np.ndarray):
            np.testing.assert_array_equal(a, b, strict=True)
        else:
            assert a == b


def test_round_trip(records: list[Record], tmp_path: Path) -> None:
    write_records(records, tmp_path / "evaluation")
    back = read_records(tmp_path / "evaluation")
    assert len(back) == len(records)
    for one, other in zip(records, back, strict=True):
        assert_equal(one, other)


def test_the_same_records_give_the_same_bytes(records: list[Record], tmp_path: Path) -> None:
    for name in ("a", "b"):
        write_records(records, tmp_path / name)
    names = sorted(path.name for path in (tmp_path / "a").iterdir())
    assert names == ["episodes.parquet", "rescues.parquet"]
    for name in names:
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()


def test_tables_can_be_read_without_this_package(records: list[Record], tmp_path: Path) -> None:
    write_records(records, tmp_path)
    episodes = pq.read_table(tmp_path / "episodes.parquet").to_pylist()
    rescues = pq.read_table(tmp_path / "rescues.parquet").to_pylist()
    assert [row["episode"] for row in episodes[:7]] == [0, 1, 2, 3, 4, 5, 6]
    assert [row["policy"] for row in episodes[4:6]] == ["hungarian", "greedy"]
    for row in episodes:
        own = [r for r in rescues if (r["record"], r["episode"]) == (row["record"], row["episode"])]
        assert row["rescues"] == len(own)
    assert len(episodes[0]["actions"]) == 14 * 4
    assert episodes[5]["actions"] is None
    for row in rescues:
        assert row["helper_0"] in ("food_0", "food_1")
        partner = {"task_1": "medical_0", "task_2": "navigation_0"}[row["task"]]
        assert row["helper_1"] == partner


def test_no_rescue_at_all(tmp_path: Path) -> None:
    worlds = Scenario.preset("single").replace(episode_steps=1)
    record = run_episodes(scripted_policy("random", worlds), worlds, 2, 0)
    assert not len(record.rescues)
    write_records([record], tmp_path)
    assert_equal(read_records(tmp_path)[0], record)


@pytest.mark.parametrize("name", ["episodes.parquet", "rescues.parquet"])
@pytest.mark.parametrize("damage", ["missing", "truncated", "foreign", "text"])
def test_damaged_files_are_refused(
    records: list[Record], tmp_path: Path, name: str, damage: str
) -> None:
    write_records(records, tmp_path)
    path = tmp_path / name
    if damage == "missing":
        path.unlink()
    elif damage == "truncated":
        path.write_bytes(path.read_bytes()[:-20])
    elif damage == "foreign":
        pq.write_table(pa.table({"record": [0]}), path)
    else:
        path.write_text("policy,episode\n")
    with pytest.raises(RunError) as caught:
        read_records(tmp_path)
    assert str(path) in str(caught.value)


def test_an_unknown_version_is_refused(
    records: list[Record], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("innerattn.records.parquet.SCHEMA_VERSION", 2)
    write_records(records, tmp_path)
    monkeypatch.undo()
    with pytest.raises(RunError, match="schema version 2, only 1"):
        read_records(tmp_path)


def test_files_of_two_evaluations_are_refused(records: list[Record], tmp_path: Path) -> None:
    """Also where only the episodes differ, and nothing that describes them."""
    others = [replace(records[0], seed=3), run_like(records[0], first_episode=5)]
    for number, other in enumerate(others):
        write_records([records[0]], tmp_path / "one")
        write_records([other], tmp_path / "other")
        (tmp_path / "other" / "rescues.parquet").replace(tmp_path / "one" / "rescues.parquet")
        with pytest.raises(RunError, match=["of different episodes", "do not fit"][number]):
            read_records(tmp_path / "one")


def run_like(record: Record, first_episode: int) -> Record:
    """The same policy in the worlds of other episodes, numbered as if they were the same."""
    policy = scripted_policy(record.policy, record.scenario)
    found = run_episodes(
        policy, record.scenario, 5, record.seed, first_episode=first_episode, record=FIELDS
    )
    steps = {**found.steps, "attention": record.steps["attention"]}
    rescues = found.rescues.copy()
    rescues["episode"] -= first_episode
    assert (np.bincount(rescues["episode"], minlength=5) != record.rescue_counts()).any()
    return replace(found, first_episode=0, rescues=rescues, steps=steps)


@pytest.mark.parametrize("head", ["[]", "3", '{"records": []}', '{"schema_version": 1}'])
def test_files_described_by_something_else_are_refused(
    records: list[Record], tmp_path: Path, head: str
) -> None:
    write_records(records, tmp_path)
    for name in ("episodes.parquet", "rescues.parquet"):
        table = pq.read_table(tmp_path / name)
        pq.write_table(table.replace_schema_metadata({FORMAT: head}), tmp_path / name)
    with pytest.raises(RunError, match="not a file of"):
        read_records(tmp_path)


def test_a_description_without_episodes_is_refused(records: list[Record], tmp_path: Path) -> None:
    write_records(records, tmp_path)
    path = tmp_path / "episodes.parquet"
    table = pq.read_table(path)
    pq.write_table(table.filter(pa.compute.less(table["record"], 3)), path)
    with pytest.raises(RunError, match="do not fit their description"):
        read_records(tmp_path)
