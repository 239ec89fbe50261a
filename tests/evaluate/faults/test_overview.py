"""The numbers of the tables on faults against plain means."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from innerattn.config import Scenario
from innerattn.evaluate.faults.grid import Grid, Retention, Window
from innerattn.evaluate.faults.overview import overview, weight_without_fault
from innerattn.stats.bootstrap import Resampled

GRID = Grid(Scenario(), kinds=("motor_gain", "blackout"), severities=(0.5, 1.0))


def some(rng: np.random.Generator, *shape: int) -> Resampled:
    return Resampled(rng.uniform(size=shape), rng.uniform(size=(*shape, 50)))


def window(rng: np.random.Generator) -> Window:
    return Window(some(rng), some(rng, 2, 2, 4), some(rng, 2, 2, 4))


def test_means_over_robots_severities_and_onsets() -> None:
    rng = np.random.default_rng(0)
    early, late = window(rng), window(rng)
    retained = Retention(
        start=window(rng),
        middle=window(rng),
        early=early,
        late=late,
        cells=some(rng, 2, 2, 4, 2),
        areas=some(rng, 2, 4, 2),
        rescues_by_kind=some(rng, 2),
    )
    found = overview(GRID, retained)
    assert found.rescues == retained.start.clean.estimate()
    assert found.rescues_with_fault.mean == pytest.approx(retained.rescues_by_kind.value.mean())
    assert found.retention.mean == pytest.approx(retained.areas.value.mean())
    cells = retained.cells.value
    for k, kind in enumerate(found.kinds):
        assert kind.kind == GRID.kinds[k]
        assert kind.rescues.mean == retained.rescues_by_kind.value[k]
        assert kind.retention.mean == pytest.approx(retained.areas.value[k].mean())
        plain = [np.mean([cells[k, s, r, 0] for r in range(4)]) for s in range(2)]
        assert kind.by_severity == pytest.approx(plain)
        worst = int(np.argmin(cells[k, 1, :, 0]))
        assert kind.worst_robot == GRID.scenario.robots[worst].name
        assert kind.worst.mean == cells[k, 1, worst, 0]
        parts = [part.retention for part in (early, late)]
        means = [part.value[k].mean() for part in parts]
        assert kind.early.mean == pytest.approx(means[0])
        assert kind.late.mean == pytest.approx(means[1])
        assert kind.change.mean == pytest.approx(means[1] - means[0])
        before, after = (part.resampled[k].mean((0, 1)) for part in parts)
        low, high = np.percentile(after - before, [2.5, 97.5])
        assert (kind.change.low, kind.change.high) == pytest.approx((low, high))


def test_the_weight_without_a_fault_is_that_after_it_less_its_effect() -> None:
    def of(after: float, effect: float) -> Any:
        mean = SimpleNamespace
        return SimpleNamespace(
            after=mean(mean=mean(mean=after)), effect=mean(mean=mean(mean=effect))
        )

    found: Any = SimpleNamespace(robots=(of(0.5, 0.2), of(0.1, -0.3)))
    assert weight_without_fault(found) == pytest.approx(0.35)
