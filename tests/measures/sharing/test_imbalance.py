"""Imbalance of teams of any size, against plain loops and by hand."""

from dataclasses import replace

import numpy as np
import pytest

from innerattn.config import Robot, Scenario, Task
from innerattn.evaluate.play import run_episodes
from innerattn.measures.sharing.imbalance import helpers_by_need, workload_imbalance
from innerattn.policies import scripted_policy
from innerattn.records.record import Record

ABILITIES = ("a", "b", "c", "d")
LISTS = Scenario(
    robots=tuple(
        Robot(name=name, kind=name, abilities=tuple(own), max_speed_mps=1.0, mass_kg=1.0)
        for name, own in {"r0": "a", "r1": "ab", "r2": "abc", "r3": "bd", "r4": "a"}.items()
    ),
    tasks=(
        Task(name="first", needs=("a", "b")),
        Task(name="second", needs=("c", "a", "a")),
        Task(name="third", needs=("d",)),
    ),
)
SUMS = LISTS.replace(tasks=(Task(name="heavy", needs={"a": 2.0, "b": 1.0}), *LISTS.tasks[1:]))


def played(scenario: Scenario, episodes: int = 20) -> Record:
    return run_episodes(scripted_policy("greedy", scenario), scenario, episodes, 3)


def by_plain_loops(record: Record) -> dict[tuple[str, str], dict[str, int]]:
    """Rescues by task and ability, of robots by name."""
    found: dict[tuple[str, str], dict[str, int]] = {}
    for task in record.scenario.tasks:
        for ability in ABILITIES:
            able = [one.name for one in record.scenario.robots if ability in one.abilities]
            if ability in task.needs and len(able) > 1:
                found[task.name, ability] = dict.fromkeys(able, 0)
    for event in record.rescues:
        task = record.scenario.tasks[event["task"]]
        columns = [name for name in record.rescues.dtype.names or () if name.startswith("helper_")]
        for column in range(len(columns)):
            robot = event[f"helper_{column}"]
            if robot < 0:
                continue
            met = list(task.roles[column : column + 1]) or list(task.sums)
            for ability in met:
                counts = found.get((task.name, ability), {})
                if record.robot_names[robot] in counts:
                    counts[record.robot_names[robot]] += 1
    return found


@pytest.mark.parametrize("scenario", [LISTS, SUMS], ids=["lists", "sums"])
def test_helpers_are_counted_by_need(scenario: Scenario) -> None:
    record = played(scenario)
    found, plain = helpers_by_need(record), by_plain_loops(record)
    assert [one.tolist() for one in found] == [[*counts.values()] for counts in plain.values()]
    assert list(plain) == [(task, one) for task, one in plain if one in "ab"]
    assert all(sum(counts.values()) for counts in plain.values())
    far = [
        sum(abs(n / sum(counts.values()) - 1 / len(counts)) for n in counts.values()) / 2
        for counts in plain.values()
    ]
    assert workload_imbalance(record) == pytest.approx(np.mean(far))


def test_by_hand() -> None:
    team = Scenario.preset("mixed-8")  # four robots bring food, two medicine, two information
    events = played(team, 2).rescues[:1].repeat(4)
    events["task"] = [0, 0, 1, 1]
    food, _, _, other = 0, 1, 2, 3
    needs = {index: task.roles for index, task in enumerate(team.tasks)}
    able = {
        ability: [i for i, one in enumerate(team.robots) if ability in one.abilities]
        for ability in ("food", "medicine", "information")
    }
    for event, turn in zip(events, (food, other, food, food), strict=True):
        for column, ability in enumerate(needs[int(event["task"])]):
            event[f"helper_{column}"] = able[ability][turn if ability == "food" else 0]
    record = replace(played(team, 2), rescues=events)
    # Task 1: food 1, 0, 0, 1 of 4 is 0.5 away; one of two, 0.5. Task 2: food 2, 0, 0, 0 is 0.75.
    assert workload_imbalance(record) == pytest.approx(np.mean([0.5, 0.5, 0.75, 0.5]))


def test_it_is_the_distance_from_one_half_of_two_robots() -> None:
    record = played(Scenario.preset("mixed"))
    helped = np.zeros((2, 2))
    for event in record.rescues:
        helped[event["task"], event["helper_0"]] += 1
    shares = helped[:, 0] / helped.sum(1)
    assert workload_imbalance(record) == pytest.approx(np.abs(shares - 0.5).mean())


def test_it_needs_rescues_of_each_task_that_robots_share() -> None:
    record = played(LISTS)
    none_of_third = record.rescues[record.rescues["task"] != 2]
    assert workload_imbalance(replace(record, rescues=none_of_third)) is not None
    none_of_first = record.rescues[record.rescues["task"] != 0]
    assert workload_imbalance(replace(record, rescues=none_of_first)) is None
    alone = LISTS.replace(tasks=LISTS.tasks[2:])
    assert workload_imbalance(played(alone)) is None
