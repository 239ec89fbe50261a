"""What a memory does not go with."""

import re

import pytest

from innerattn.config.load import load_run_config
from innerattn.errors import ConfigError


@pytest.mark.parametrize(
    ("method", "values", "message"),
    [
        ("td-inner", {}, "network.memory_width = 8: train.method = 'td-inner' has no memory; must"),
        ("team-inner", {}, "must be 0, or a method of ppo-inner, ppo-uniform, "),
        (
            "ppo-inner",
            {"train.warm_start": "hungarian"},
            "network.memory_width = 8: train.warm_start = 'hungarian' imitates single steps; must",
        ),
        (
            "mappo",
            {"ppo.sequence_steps": 4, "ppo.rollout_steps": 10},
            "ppo.sequence_steps = 4: must divide ppo.rollout_steps = 10, because network.memory_w",
        ),
        ("ppo-inner", {"network.memory_width": 6}, "network.memory_width = 6: must be a multiple"),
    ],
)
def test_what_it_does_not_go_with(method: str, values: dict[str, object], message: str) -> None:
    with pytest.raises(ConfigError, match=re.escape(message)):
        load_run_config(method=method, overrides={"network.memory_width": 8, **values})


def test_without_one_sequences_do_not_matter() -> None:
    config = load_run_config(method="mappo", overrides={"ppo.rollout_steps": 7})
    assert config.ppo.sequence_steps == 5
    overrides = {"network.memory_width": 8, "ppo.rollout_steps": 7, "ppo.sequence_steps": 7}
    found = load_run_config(method="mappo", overrides=overrides)
    assert found.network.memory_width == 8
    assert found.digest() != config.digest()
