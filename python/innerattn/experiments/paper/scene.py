"""Which handoff is shown as Fig. 5, by a fixed rule, so that nobody picks the prettiest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from innerattn.config import Scenario
from innerattn.experiments.run import FinishedRun
from innerattn.measures.sharing.handoff import alike_robots, handoffs

SCHEMA_VERSION = 1

SCENE_RULE = (
    "of the run of lowest seed and the first food robot's handoffs from the first task to the "
    "second, the one whose shorter stage (before or after the first rescue) is longest, then the "
    "longest in all, then the first"
)
"""How the handoff that is shown is chosen; it looks at no attention weight."""


@dataclass(frozen=True)
class HandoffScene:
    """One handoff; T steps of its episode, R robots, V victim slots, H heads.

    Attributes:
        scenario: the worlds.
        title: where it is from.
        robot: index of the robot that hands over.
        before: index of its partner in the first rescue.
        after: index of its partner in the second.
        tasks: names of the tasks of the two rescues.
        start: step at which the first stage begins.
        first: step whose action completes the first rescue.
        second: step whose action completes the second.
        positions: (T, R, 2) before each step's action [m].
        victims: (T, V) structured; present, task, x, y [m].
        weights: (T, H, R) of the robot on each robot.
    """

    scenario: Scenario
    title: str
    robot: int
    before: int
    after: int
    tasks: tuple[str, str]
    start: int
    first: int
    second: int
    positions: NDArray[np.float32]
    victims: NDArray[np.void]
    weights: NDArray[np.float32]

    @property
    def stages(self) -> tuple[tuple[int, int], ...]:
        """First and last step of the trails of each stage; the last is where robots are drawn."""
        middle = (self.first + 1 + self.second) // 2
        return (self.start, self.first), (self.first, middle), (middle, self.second)


def choose_scene(group: Sequence[FinishedRun]) -> HandoffScene | None:
    """The handoff that is shown, by `SCENE_RULE`.

    Args:
        group: runs of one situation and method, in order of seeds.

    Returns:
        None where the first run has no attention, not two tasks of two needs, or no such handoff.
    """
    run, record = group[0], group[0].recorded
    tasks = [task.name for task in record.scenario.tasks if len(task.roles) == 2]
    alike = alike_robots(record)
    if "attention" not in record.steps or len(tasks) < 2 or not alike:
        return None
    found = handoffs(record, alike[0], tasks[0], tasks[1])
    if not len(found):
        return None
    before = found["first"] - found["start"] + 1
    after = found["second"] - found["first"]
    shorter, whole = np.minimum(before, after), before + after
    chosen = found[np.lexsort((np.arange(len(found)), -whole, -shorter))[0]]
    episode = int(chosen["episode"]) - record.first_episode
    robot, steps = int(chosen["robot"]), record.steps
    return HandoffScene(
        scenario=record.scenario,
        title=f"{run.situation}, {run.method}, seed {run.seed}, episode {int(chosen['episode'])}",
        robot=robot,
        before=int(chosen["before"]),
        after=int(chosen["after"]),
        tasks=(tasks[0], tasks[1]),
        start=int(chosen["start"]),
        first=int(chosen["first"]),
        second=int(chosen["second"]),
        positions=steps["positions"][episode],
        victims=steps["victims"][episode],
        weights=steps["attention"][episode, :, :, robot],
    )


def scene_json(scene: HandoffScene) -> dict[str, Any]:
    """The document of ``fig5.json``: the steps of the handoff, start to second."""
    shown = slice(scene.start, scene.second + 1)
    names = [robot.name for robot in scene.scenario.robots]
    tasks = [task.name for task in scene.scenario.tasks]
    victims = [
        [
            {"task": tasks[int(v["task"])], "x": float(v["x"]), "y": float(v["y"])}
            for v in step[step["present"].astype(bool)]
        ]
        for step in scene.victims[shown]
    ]
    return {
        "schema_version": SCHEMA_VERSION,
        "title": scene.title,
        "rule": SCENE_RULE,
        "robots": names,
        "robot": names[scene.robot],
        "before": names[scene.before],
        "after": names[scene.after],
        "tasks": list(scene.tasks),
        "steps": list(range(scene.start, scene.second + 1)),
        "first": scene.first,
        "second": scene.second,
        "stages": [list(stage) for stage in scene.stages],
        "positions_by_step_robot": scene.positions[shown].tolist(),
        "victims_by_step": victims,
        "weights_by_step_head_robot": scene.weights[shown].tolist(),
    }
