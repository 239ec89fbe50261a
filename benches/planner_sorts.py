"""How well the learnt policy for instances does on sorts that it was not trained on.

`python benches/planner_sorts.py` fills two tables in `docs/instances.md`: mean makespans of the
planners divided by that of `greedy`, for equal numbers of orders and for equal time.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path
from statistics import mean

import numpy as np
from page import machine, publish, table

from innerattn.config.instances import Instance
from innerattn.config.instances.draw import InstanceSort, draw_instance
from innerattn.policies.scripted.planner import schedule_by

PAGE = Path(__file__).parents[1] / "docs" / "instances.md"
INSTANCES = 100
SEED = 1
ORDERS = 2_000
SORTS = {
    "as in training: 20 tasks, 15 robots, 5 skills": InstanceSort(),
    "10 tasks": InstanceSort(tasks=(10, 10)),
    "40 tasks": InstanceSort(tasks=(40, 40)),
    "8 skills, 24 robots, needs of 2.5 on average": InstanceSort(skills=8, need_share=0.3),
    "one robot for each skill": InstanceSort(robots_per_skill=1),
    "tasks a tenth as long": InstanceSort(most_duration=0.5),
}
SIZES = (20, 40, 100)
"""Numbers of tasks, for equal time."""
TIMED = 10
"""Instances of each of them."""
SECONDS = 4.0


def main() -> None:
    """Measures and publishes."""
    head = ["instances", "learnt", "planner", "guided"]
    rows = []
    for name, sort in SORTS.items():
        instances = drawn(sort, INSTANCES)
        greedy = makespan("greedy", instances, None)
        ratios = [makespan(planner, instances, None) / greedy for planner in head[1:]]
        rows.append([name, *(f"{ratio:.3f}" for ratio in ratios)])
    publish("planner_sorts", table(head, rows), PAGE)
    head = ["tasks", "learnt", "seconds", f"planner, {SECONDS:g} s", f"guided, {SECONDS:g} s"]
    rows = [of_size(tasks) for tasks in SIZES]
    note = f"{machine()}. {TIMED} random instances of each size, one core, seed 0."
    publish("planner_sizes", f"{table(head, rows)}\n\n{note}", PAGE)


def of_size(tasks: int) -> list[str]:
    """A row of the second table."""
    instances = drawn(InstanceSort(tasks=(tasks, tasks)), TIMED)
    greedy = makespan("greedy", instances, None)
    began = time.perf_counter()
    learnt = makespan("learnt", instances, None) / greedy
    seconds = (time.perf_counter() - began) / TIMED
    ratios = [makespan(planner, instances, SECONDS) / greedy for planner in ("planner", "guided")]
    return [f"{tasks}", f"{learnt:.3f}", f"{seconds:.2f}", *(f"{ratio:.3f}" for ratio in ratios)]


def drawn(sort: InstanceSort, count: int) -> list[Instance]:
    """Random instances of a sort."""
    draws = np.random.default_rng(SEED)
    return [draw_instance(sort, draws) for _ in range(count)]


def makespan(planner: str, instances: Sequence[Instance], seconds: float | None) -> float:
    """Mean of a planner's schedules; without a time limit it tries `ORDERS` orders."""
    orders = ORDERS if seconds is None else None
    found = (schedule_by(planner, one, seconds, 0, orders) for one in instances)
    return mean(one.makespan for one in found)


if __name__ == "__main__":
    main()
