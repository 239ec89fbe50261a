"""What the page of a schedule holds, beside plain code that plays the schedule."""

import json
import math

from drawn_instances import instances
from hypothesis import given
from hypothesis import strategies as st
from played_schedule import played, travel

from innerattn.config.instances import Instance, read_instances
from innerattn.policies.scripted.planner import PLANNERS, Schedule, schedule_by, simulate
from innerattn.report.schedule.data import schedule_document


def check(instance: Instance, schedule: Schedule) -> None:
    """Compare spans with the times and ways that plain code gives, to the last bit."""
    document = json.loads(json.dumps(schedule_document(instance, schedule), allow_nan=False))
    plain = played(instance, schedule.tasks)
    assert plain is not None
    starts, returns = plain
    assert [task["start"] for task in document["tasks"]] == starts
    arrivals: list[list[float]] = [[] for _ in instance.tasks]
    for robot, row in enumerate(schedule.tasks):
        spans = document["robots"][robot]["spans"]
        assert [task for what, _, _, task in spans if what == "work"] == list(row)
        now, place, depot = 0.0, instance.robots[robot].depot, instance.robots[robot].depot
        for what, begin, end, index in spans:
            assert begin == now <= end
            now = end
            if what == "home":
                assert end == begin + travel(instance, place, depot) == returns[robot]
                continue
            task = instance.tasks[index]
            if what == "drive":
                assert end == begin + travel(instance, place, task.position)
                arrivals[index].append(end)
                place = task.position
            elif what == "wait":
                assert begin < end == starts[index]
            else:
                assert what == "work"
                assert (begin, end) == (starts[index], starts[index] + task.duration)
        assert [what for what, *_ in spans][-1:] == (["home"] if row else [])
        assert now == returns[robot]
    assert [max(times) for times in arrivals] == starts
    for task, described, times in zip(instance.tasks, document["tasks"], arrivals, strict=True):
        assert len(described["robots"]) == len(task.skills) == len(times)
        assert described["end"] == described["start"] + task.duration
    ends = [end for robot in document["robots"] for *_, end, _ in robot["spans"]]
    assert max(ends) == document["makespan"] == schedule.makespan


@given(instances(), st.integers(0, 99), st.sampled_from(["greedy", "random"]))
def test_spans_are_what_the_simulation_says(instance: Instance, seed: int, name: str) -> None:
    check(instance, schedule_by(name, instance, 0.0, seed))


def test_spans_of_published_instances() -> None:
    for instance in read_instances("ral")[:6]:
        for name in PLANNERS:
            check(instance, schedule_by(name, instance, 0.005, 1))


@given(instances())
def test_all_places_lie_on_the_map(instance: Instance) -> None:
    document = schedule_document(instance, schedule_by("greedy", instance, 0.0, 0))
    left, bottom, side = document["extent"]
    places = [robot.depot for robot in instance.robots]
    places += [task.position for task in instance.tasks]
    if all(0 <= value <= 1 for place in places for value in place):
        assert (left, bottom, side) == (0, 0, 1)
    slack = 1e-9 * side
    for x, y in places:
        assert left - slack <= x <= left + side + slack
        assert bottom - slack <= y <= bottom + side + slack
    widths = [max(values) - min(values) for values in zip(*places, strict=True)]
    assert (left, bottom, side) == (0, 0, 1) or math.isclose(side, max(widths) or 1.0)


def test_a_robot_without_work_does_nothing_and_kinds_are_sets_of_skills() -> None:
    table = {
        "name": "one",
        "speed": 2.0,
        "robots": [{"depot": (5.0, 5.0), "skills": skills} for skills in ([1, 0], [0, 1], [0])],
        "tasks": [{"position": (5.0, 9.0), "skills": [0], "duration": 1.0}],
    }
    instance = Instance.model_validate(table)
    document = schedule_document(instance, simulate(instance, [[], [0], []]))
    spans = [("drive", 0.0, 2.0, 0), ("work", 2.0, 3.0, 0), ("home", 3.0, 5.0, None)]
    assert [robot["spans"] for robot in document["robots"]] == [[], spans, []]
    assert [robot["kind"] for robot in document["robots"]] == [0, 0, 1]
    assert (document["makespan"], document["extent"]) == (5.0, (3.0, 5.0, 4.0))
