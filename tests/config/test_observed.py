"""Observations with the nearest teammates alone: what they refuse."""

import pytest

from innerattn.config import Scenario, load_run_config
from innerattn.errors import ConfigError


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"observed_teammates": 64}, "observed_teammates = 64: must be in 0..=63"),
        ({"observed_victims": 0}, "observed_victims = 0: must be in 1..=32"),
        (
            {"observed_victims": 1, "victim_order": "slot"},
            'observed_victims = 1: must be none where victim_order = "slot"',
        ),
    ],
)
def test_wrong_numbers_are_refused(values: dict[str, object], message: str) -> None:
    with pytest.raises(ConfigError, match=f"scenario.{message}"):
        Scenario().replace(**values)


@pytest.mark.parametrize(
    ("method", "values", "message"),
    [
        (
            "ppo-inner",
            {"network.message_width": 8},
            "scenario.observed_teammates = 2: must be left out where robots have messages "
            r"\(network.message_width = 8\)",
        ),
        (
            "ppo-oracle",
            {"network.symmetry": "canonical"},
            "network.symmetry = 'canonical': must be 'none' where the attention is 'oracle'",
        ),
    ],
)
def test_what_needs_every_teammate_refuses_it(
    method: str, values: dict[str, object], message: str
) -> None:
    values = {"scenario.observed_teammates": 2, **values}
    with pytest.raises(ConfigError, match=message):
        load_run_config(method=method, overrides=values)
    del values["scenario.observed_teammates"]
    load_run_config(method=method, overrides=values)
