"""Rows with the nearest teammates and the first victims alone, beside the plain stepper."""

import numpy as np
import pytest
from teams import with_communication, with_loads, with_sight, with_wheels
from test_stepper import THIRDS, compare_some

from innerattn.config import Scenario


@pytest.mark.parametrize("chunk", THIRDS)
def test_worlds_with_short_rows_are_as_the_plain_stepper_says(chunk: int) -> None:
    rng = np.random.default_rng(1500 + chunk)
    rows = {"fewer": 0, "all sorted": 0, "no teammates": 0, "fewer victims": 0}

    def changed(scenario: Scenario) -> Scenario:
        for other in (with_loads, with_wheels):
            scenario = other(scenario, rng) if rng.random() < 0.3 else scenario
        if rng.random() < 0.5:
            scenario = with_sight(scenario, rng)
            scenario = with_communication(scenario, rng) if rng.random() < 0.5 else scenario
        leaves = ("stay", "leave")[rng.integers(2)]
        victims = None
        if scenario.victim_order == "relevant" and rng.random() < 0.7:
            victims = int(rng.integers(1, 4))
        teammates = int(rng.integers(len(scenario.robots) + 2))
        rows["fewer"] += teammates < len(scenario.robots) - 1
        rows["all sorted"] += teammates >= len(scenario.robots) - 1
        rows["no teammates"] += teammates == 0
        rows["fewer victims"] += (victims or 32) < scenario.num_victims
        return scenario.replace(
            observed_teammates=teammates, observed_victims=victims, unavailable_robots=leaves
        )

    total = compare_some(rng, changed)
    for what in ("rescues", "appeared", "unavailable", "left"):
        assert total[what] > 50, (what, total)
    assert min(rows.values()) > 0, rows
