"""What the benchmark of the planner says of results."""

import pytest
from planner_quality import makespan, row, shorter

from innerattn.config.instances import read_instances
from innerattn.evaluate.instances import InstanceResults, Solved


def test_schedules_are_counted_that_are_shorter_than_published() -> None:
    instances = read_instances("ral")[:4]
    factors = (0.9, 1.0, 0.99, 1.2)
    solved = [
        Solved(one, factor * makespan(one), 0.1)
        for one, factor in zip(instances, factors, strict=True)
    ]
    results = InstanceResults("planner", 0, 10, tuple(solved))
    assert shorter(results) == 2
    total = sum(map(makespan, instances))
    assert results.ratio == pytest.approx(sum(one.makespan for one in solved) / total)


def test_a_row_has_means_over_seeds() -> None:
    instances = read_instances("ral")[:2]
    name, mean, ratio, count, _ = row("plain", "greedy", instances, 1)
    assert (name, mean, count) == ("plain", "27.63", "0.0")
    assert float(ratio) == pytest.approx(27.63 / 25.51, abs=1e-3)
