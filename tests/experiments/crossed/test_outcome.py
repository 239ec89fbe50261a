"""What one run of the crossed design shows, against a plain loop over its rescues."""

from dataclasses import replace

import numpy as np
import pytest

from innerattn.errors import RunError
from innerattn.experiments.crossed.outcome import outcome_of
from innerattn.experiments.run import FinishedRun


def test_outcome_against_a_plain_loop(runs: list[FinishedRun]) -> None:
    measured = runs[0]
    found = outcome_of(measured)
    scenario = measured.recorded.scenario
    by_index = dict(enumerate(task.name for task in scenario.tasks))
    helped = {name: [0, 0] for name in by_index.values()}
    for record in measured.scored:
        for event in record.rescues:
            for need, ability in enumerate(scenario.tasks[event["task"]].needs):
                if ability == "food":
                    robot = int(event[f"helper_{need}"])
                    helped[by_index[int(event["task"])]][robot] += 1
    distances = [abs(first / (first + second) - 0.5) for first, second in helped.values()]
    total = np.sum(list(helped.values()), axis=0)
    assert found.imbalance == pytest.approx(np.mean(distances))
    assert found.least_share == pytest.approx(min(total) / sum(total))
    assert found.first_share == pytest.approx(total[0] / sum(total))
    assert found.rescues_per_episode == measured.summary["rescues_per_episode"]["mean"]
    shares = np.concatenate(list(measured.summary["attention_entropy_share"].values()))
    assert found.entropy_share == pytest.approx(shares.mean())


def test_a_task_that_two_robots_do_not_share_is_refused(runs: list[FinishedRun]) -> None:
    measured = runs[0]
    robots = measured.recorded.scenario.robots
    third = robots[0].model_copy(update={"name": "food_2"})
    changed = measured.recorded.scenario.replace(robots=[*robots, third])
    scored = tuple(replace(record, scenario=changed) for record in measured.scored)
    with pytest.raises(RunError, match="is shared by 3 robots; must be two"):
        outcome_of(replace(measured, read=lambda: scored))
