"""Helpers of victims whose needs are sums, counted by plain loops over played episodes."""

import numpy as np
import pytest

from innerattn.config import Scenario
from innerattn.evaluate.play import run_episodes
from innerattn.measures import measures_of
from innerattn.measures.cooperation import count_cooperation
from innerattn.measures.dispatch_quality import choices_of
from innerattn.measures.sharing.evenness import counts_by_episode
from innerattn.measures.sharing.handoff import handoffs
from innerattn.policies import scripted_policy
from innerattn.records import read_records, write_records
from innerattn.records.record import Record


def scenario(situation: str = "mixed") -> Scenario:
    """Food is a sum in the first task; the second one has a list."""
    robots = [robot.model_dump() for robot in Scenario().robots]
    robots[0]["abilities"] = {"food": 0.6}
    robots[2]["abilities"] = {"food": 0.5, "information": 1.0}
    robots[3]["abilities"] = {"food": 0.4, "medicine": 1.0}
    tasks = [{"name": "hunger", "needs": {"food": 1.45}}, Scenario().tasks[1]]
    return Scenario.preset(situation).replace(robots=robots, tasks=tasks, rescue_radius_m=0.3)


def record_of(policy: str = "hungarian", situation: str = "mixed") -> Record:
    worlds = scenario(situation)
    fields = ("positions", "velocities", "victims")
    return run_episodes(scripted_policy(policy, worlds), worlds, 30, 8, record=fields)


def helpers_of(row: np.void) -> list[int]:
    return [row[f"helper_{k}"] for k in range(4) if row[f"helper_{k}"] >= 0]


def test_the_measure_against_a_plain_loop() -> None:
    record = record_of()
    counts = [len(helpers_of(row)) for row in record.rescues if row["task"] == 0]
    assert set(counts) == {2, 3}
    found = measures_of(record)["helpers"]
    assert found is not None
    assert found.mean == pytest.approx(np.mean(counts))


def test_a_scenario_of_lists_has_no_such_measure() -> None:
    worlds = Scenario.preset("mixed")
    record = run_episodes(scripted_policy("greedy", worlds), worlds, 4, 4)
    assert "helpers" not in measures_of(record)


def test_other_measures_count_every_helper() -> None:
    record = record_of("greedy", "double")
    wanted = {"hunger": [0, 0, 0, 0], "task_2": [0, 0, 0, 0]}
    for row in record.rescues:
        name = ("hunger", "task_2")[row["task"]]
        for robot in helpers_of(row):
            if name == "hunger" or robot == row["helper_0"]:
                wanted[name][robot] += 1
    found = count_cooperation(record.rescues, record.scenario)
    for name, counts in wanted.items():
        assert found[name] == dict(zip(record.robot_names, counts, strict=True))
    assert sum(wanted["hunger"]) >= 2 * (record.rescues["task"] == 0).sum() > 0
    by_episode = counts_by_episode(record)
    assert by_episode["hunger"].sum(0).tolist() == wanted["hunger"]
    # Who should have gone alone is a question of lists.
    lists = (record.rescues["task"] == 1).sum()
    assert len(choices_of(record).helper) == lists
    with pytest.raises(ValueError, match="0 needs: must have a list of 2"):
        handoffs(record, "food_0", "hunger", "task_2")


def test_records_keep_every_helper(tmp_path) -> None:  # type: ignore[no-untyped-def]
    record = record_of()
    write_records([record], tmp_path)
    (back,) = read_records(tmp_path)
    assert back.scenario == record.scenario
    np.testing.assert_array_equal(back.rescues, record.rescues, strict=True)
