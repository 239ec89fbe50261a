"""How well the learnt policy for instances does on sorts that it was not trained on.

`python benches/planner_sorts.py` fills a table in `docs/instances.md`: mean makespans of the
planners divided by that of `greedy`. They do not depend on the speed of the machine.
"""

from __future__ import annotations

from pathlib import Path
from statistics import mean

import numpy as np
from page import publish, table

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
HEAD = ["instances", "learnt", "planner", "guided"]


def main() -> None:
    """Measures and publishes."""
    rows = []
    for name, sort in SORTS.items():
        draws = np.random.default_rng(SEED)
        instances = [draw_instance(sort, draws) for _ in range(INSTANCES)]

        def makespan(planner: str, instances: list[Instance] = instances) -> float:
            found = (schedule_by(planner, one, None, 0, ORDERS) for one in instances)
            return mean(one.makespan for one in found)

        greedy = makespan("greedy")
        rows.append([name, *(f"{makespan(planner) / greedy:.3f}" for planner in HEAD[1:])])
    publish("planner_sorts", table(HEAD, rows), PAGE)


if __name__ == "__main__":
    main()
