"""Lost victims in record files: kept, left out where there are none, and checked."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from innerattn.config import Scenario
from innerattn.errors import RunError
from innerattn.evaluate.play import run_episodes
from innerattn.policies import scripted_policy
from innerattn.records import read_records, write_records
from innerattn.records.record import LOST_DTYPE, Record


def record_of(**times: object) -> Record:
    plain = Scenario.preset("double")
    worlds = plain.replace(tasks=tuple(task.replace(**times) for task in plain.tasks))
    policy = scripted_policy("random", worlds)
    return run_episodes(policy, worlds, 6, 2, first_episode=4, record=("victims",))


def test_they_are_read_as_they_were_written_beside_records_without_any(tmp_path: Path) -> None:
    timed, plain = record_of(deadline_s=(0.5, 1.5)), record_of(service_s=0.2)
    assert len(timed.lost) > 20
    assert not len(plain.lost)
    write_records([timed, plain], tmp_path)
    for steps in (True, False):
        for one, other in zip([timed, plain], read_records(tmp_path, steps=steps), strict=True):
            np.testing.assert_array_equal(one.lost, other.lost, strict=True)
            assert one.scenario == other.scenario


def test_a_file_of_worlds_without_deadlines_has_no_column_for_them(tmp_path: Path) -> None:
    write_records([record_of()], tmp_path)
    assert "lost" not in pq.read_schema(tmp_path / "episodes.parquet").names
    (back,) = read_records(tmp_path)
    assert back.lost.dtype == LOST_DTYPE


def test_who_was_blocked_is_read_as_it_was_written(tmp_path: Path) -> None:
    plain = Scenario.preset("double")
    worlds = plain.replace(tasks=(plain.tasks[0], plain.tasks[1].replace(after=("task_1",))))
    policy = scripted_policy("hungarian", worlds)
    record = run_episodes(policy, worlds, 6, 2, record=("victims",))
    assert record.steps["victims"]["blocked"].any()
    write_records([record], tmp_path)
    (back,) = read_records(tmp_path, steps=True)
    np.testing.assert_array_equal(back.steps["victims"], record.steps["victims"], strict=True)


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("step", 25, "step of a loss"),
        ("step", -1, "step of a loss"),
        ("slot", 2, "slot of a loss"),
        ("victim", -1, "victim of a loss"),
        ("task", 2, "task of a loss"),
    ],
)
def test_what_no_play_leaves_behind_is_refused(
    field: str, value: int, message: str, tmp_path: Path
) -> None:
    record = record_of(deadline_s=1.0)
    lost = record.lost.copy()
    lost[field][3] = value
    write_records([replace(record, lost=lost)], tmp_path)
    with pytest.raises(RunError, match=message):
        read_records(tmp_path)


def test_lists_of_another_form_are_refused(tmp_path: Path) -> None:
    write_records([record_of(deadline_s=1.0)], tmp_path)
    file = tmp_path / "episodes.parquet"
    table = pq.read_table(file)
    for wrong in ([[1, 0, 0]] * 6, None):
        parts = {name: table[name] for name in table.column_names if name != "lost"}
        if wrong:
            parts["lost"] = pa.array(wrong, pa.large_list(pa.int64()))
        pq.write_table(pa.table(parts).replace_schema_metadata(table.schema.metadata), file)
        with pytest.raises(RunError, match="do not fit their description"):
            read_records(tmp_path)
