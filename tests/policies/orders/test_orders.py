"""Orders under way beside plain Python code, on random instances."""

import numpy as np
import pytest
from drawn_instances import instances
from hypothesis import given, settings
from hypothesis import strategies as st
from order_features import plain_features
from played_schedule import PlainOrder

from innerattn import _core
from innerattn.config.instances import Instance, read_instances
from innerattn.policies.orders.relations import relations_of


@settings(max_examples=40)
@given(instances(robots=5, tasks=5), st.randoms(use_true_random=False))
def test_what_is_known_of_tasks_is_what_plain_code_finds(
    instance: Instance, random: object
) -> None:
    order, plain = _core.Orders([instance.compiled()]), PlainOrder(instance)
    while plain.open:
        (rows,) = order.features()
        for task, row in enumerate(rows):
            expected = plain_features(plain, task) if task in plain.open else np.zeros(len(row))
            assert row == pytest.approx(expected, rel=1e-5, abs=1e-6)
        task = random.choice(plain.open)  # type: ignore[attr-defined]
        plain.take(task)
        order.take(np.array([task]))
        assert order.makespans()[0] == plain.makespan
    assert instance.compiled().schedule(order.orders()[0]) == plain.schedule


def test_orders_do_not_depend_on_their_neighbours() -> None:
    """Instances of other sizes beside one change nothing but the rows that are added."""
    small = Instance.model_validate(
        {
            "name": "small",
            "speed": 1.0,
            "robots": [{"depot": (0.0, 0.0), "skills": [0]}],
            "tasks": [
                {"position": (x, 0.0), "skills": [0], "duration": 1.0} for x in (1.0, 2.0, 4.0)
            ],
        }
    )
    large = read_instances("ral")[0]
    both, alone = (
        _core.Orders([small.compiled(), large.compiled()]),
        _core.Orders([small.compiled()]),
    )
    for step in range(20):
        known, shown = both.features(), alone.features()
        assert known.shape == (2, 20, _core.ORDER_FEATURES)
        assert (known[0, :3] == shown[0]).all()
        assert (known[0, 3:] == 0).all()
        task = 2 - step if step < 3 else -1
        both.take(np.array([task, step]))
        alone.take(np.array([task]))
    assert both.orders() == [[2, 1, 0], list(range(20))]


def test_what_cannot_come_next_is_refused_and_changes_nothing() -> None:
    ral = read_instances("ral")
    orders = _core.Orders([ral[0].compiled(), ral[1].compiled()])
    orders.take(np.array([3, 4]))
    for tasks, told in (
        ([5, 4], r"tasks\[1\] = 4: must be a task that is not in the order yet, -1 if there is"),
        ([20, 5], r"tasks\[0\] = 20: must be"),
        ([-1, 5], r"tasks\[0\] = -1: must be"),
        ([5], r"tasks has shape \(1,\): must be \(2,\)"),
    ):
        with pytest.raises(ValueError, match=told):
            orders.take(np.array(tasks))
    assert orders.orders() == [[3], [4]]
    with pytest.raises(ValueError, match="instances: there are 0: must be 1 or more"):
        _core.Orders([])


def test_an_order_must_have_each_task_once() -> None:
    instance = read_instances("ral")[0].compiled()
    for order in ([0, 1], [0] * 20, [*range(19), 20]):
        with pytest.raises(ValueError, match="must have each task from 0 to 19 once"):
            instance.schedule(order)
        with pytest.raises(ValueError, match="must have each task from 0 to 19 once"):
            instance.plan(0, 10, None, order)


@given(instances())
def test_relations_are_ways_and_alike_needs(instance: Instance) -> None:
    found = relations_of(instance)
    tasks = instance.tasks
    ways = np.array(
        [[np.hypot(*np.subtract(a.position, b.position)) for b in tasks] for a in tasks]
    )
    assert found[..., 0] == pytest.approx(ways / (ways.mean() or 1.0), rel=1e-5, abs=1e-6)
    for a, one in enumerate(tasks):
        for b, other in enumerate(tasks):
            shared = sum(one.skills.count(skill) * other.skills.count(skill) for skill in range(3))
            norms = [sum(t.skills.count(s) ** 2 for s in range(3)) ** 0.5 for t in (one, other)]
            assert found[a, b, 1] == pytest.approx(shared / norms[0] / norms[1], rel=1e-5)
