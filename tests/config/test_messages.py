"""What messages do not go with."""

import re

import pytest

from innerattn.config.load import load_run_config
from innerattn.errors import ConfigError


@pytest.mark.parametrize(
    ("method", "values", "message"),
    [
        (
            "td-inner",
            {},
            "network.message_width = 8: train.method = 'td-inner' has no messages; must be 0, or a "
            "method of ppo-inner, ppo-uniform, ",
        ),
        ("team-inner", {}, "train.method = 'team-inner' has no messages; must be 0, or a method"),
        (
            "ppo-inner",
            {"train.warm_start": "hungarian"},
            "network.message_width = 8: train.warm_start = 'hungarian' imitates robots that say "
            "nothing; must be 'none'",
        ),
        ("ppo-inner", {"network.message_width": 6}, "network.message_width = 6: must be a multi"),
        ("ppo-inner", {"network.message_width": -4}, "network.message_width = -4: must be great"),
        (
            "mappo",
            {"network.message_pooling": "sum"},
            "network.message_pooling = 'sum': must be 'attention', 'mean', 'max' or 'nearest'",
        ),
    ],
)
def test_what_they_do_not_go_with(method: str, values: dict[str, object], message: str) -> None:
    with pytest.raises(ConfigError, match=re.escape(message)):
        load_run_config(method=method, overrides={"network.message_width": 8, **values})


@pytest.mark.parametrize("method", ["ppo-inner", "ppo-uniform", "mappo"])
def test_methods_of_ppo_have_them(method: str) -> None:
    without = load_run_config(method=method)
    assert without.network.message_width == 0
    found = load_run_config(method=method, overrides={"network.message_width": 8})
    assert found.network.message_pooling == "attention"
    assert found.digest() != without.digest()
