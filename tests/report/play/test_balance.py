"""The imbalance that a page shows while worlds go on is that of the measure."""

import json
from importlib.resources import files
from typing import Any

import numpy as np
import pytest
from in_node import run_in_node

from innerattn.config import Robot, Scenario, Task
from innerattn.evaluate.play import run_episodes
from innerattn.measures.sharing.imbalance import workload_imbalance
from innerattn.policies import scripted_policy

COUNT = """
const { readFileSync } = require("node:fs");
const { worlds, robots, rescues } = JSON.parse(readFileSync(0, "utf8"));
const Balance = new Function(`${readFileSync(process.argv[1], "utf8")}\\nreturn Balance;`)();
const balance = new Balance(worlds, robots);
balance.add(rescues);
const { isDefined, imbalance } = balance;
process.stdout.write(JSON.stringify({ isDefined, imbalance }));
"""
OWN = {"r0": "a", "r1": "ab", "r2": "abc", "r3": "bd", "r4": "a"}
ROBOTS = tuple(
    Robot(name=name, kind=name, abilities=tuple(own), max_speed_mps=1.0, mass_kg=1.0)
    for name, own in OWN.items()
)


def in_page(scenario: Scenario, rescues: np.ndarray) -> dict[str, Any]:
    """What a page counts of some rescues."""
    names = [name for name in rescues.dtype.names or () if name.startswith("helper_")]
    told = {
        "worlds": {
            "tasks": [{"needs": list(one.needs), "amounts": one.sums} for one in scenario.tasks]
        },
        "robots": [
            {"index": index, "abilities": list(one.abilities)}
            for index, one in enumerate(scenario.robots)
        ],
        "rescues": [
            {
                "task": int(event["task"]),
                "helpers": [int(event[name]) for name in names if event[name] >= 0],
            }
            for event in rescues
        ],
    }
    script = files("innerattn.report.play") / "web" / "balance.js"
    found = json.loads(run_in_node(COUNT, script, told=json.dumps(told)))
    assert isinstance(found, dict)
    return found


@pytest.mark.parametrize("needs", [("a", "b"), ("c", "a", "a"), {"a": 2.0, "b": 1.0}], ids=str)
def test_it_is_that_of_the_measure(needs: tuple[str, ...] | dict[str, float]) -> None:
    tasks = (Task(name="first", needs=needs), Task(name="second", needs=("b", "a")))
    scenario = Scenario(robots=ROBOTS, tasks=tasks)
    record = run_episodes(scripted_policy("greedy", scenario), scenario, 20, 3)
    found = in_page(scenario, record.rescues)
    assert found["isDefined"] is True
    assert found["imbalance"] == pytest.approx(workload_imbalance(record))
    assert found["imbalance"] > 0.05


def test_where_nobody_shares_there_is_none() -> None:
    scenario = Scenario(robots=ROBOTS, tasks=(Task(name="only", needs=("c", "d")),))
    record = run_episodes(scripted_policy("greedy", scenario), scenario, 5, 3)
    assert workload_imbalance(record) is None
    assert in_page(scenario, record.rescues)["isDefined"] is False
