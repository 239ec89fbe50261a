"""The run configuration: ranges, contradictions, and what follows from the method."""

import hashlib
import json
import re
from pathlib import Path
from typing import Annotated, Any, get_args

import pytest
from pydantic import Field, ValidationError

from innerattn.config import (
    NetworkConfig,
    PPOConfig,
    RunConfig,
    Scenario,
    TDConfig,
    TrainConfig,
    load_run_config,
)
from innerattn.config.load import read_toml
from innerattn.config.model import ADDED_LATER, Model, values_for_digest
from innerattn.errors import ConfigError


@pytest.mark.parametrize(
    ("method", "attention"),
    [
        ("td-inner", "inner"),
        ("td-uniform", "uniform"),
        ("ppo-inner", "inner"),
        ("ppo-uniform", "uniform"),
        ("mappo", "none"),
    ],
)
def test_attention_follows_method(method: str, attention: str) -> None:
    train = {"method": method}
    as_tables = RunConfig.model_validate({"train": train, "network": {"hidden_width": 64}})
    as_models = RunConfig(train=TrainConfig(**train), network=NetworkConfig(hidden_width=64))
    assert as_tables == as_models
    assert (as_tables.network.attention, as_tables.network.hidden_width) == (attention, 64)


@pytest.mark.parametrize(
    ("method", "attention"), [("td-inner", "uniform"), ("td-uniform", "inner")]
)
def test_contradicting_attention_is_refused(method: str, attention: str) -> None:
    with pytest.raises(ValidationError, match=rf"network\.attention = '{attention}'.*'{method}'"):
        RunConfig.model_validate({"train": {"method": method}, "network": {"attention": attention}})


@pytest.mark.parametrize(
    ("method", "advantage"),
    [("td-inner", "counterfactual"), ("ppo-inner", "counterfactual"), ("mappo", "value")],
)
def test_advantage_follows_method(method: str, advantage: str) -> None:
    train = {"method": method}
    as_tables = RunConfig.model_validate({"train": train, "ppo": {"epochs": 2}})
    as_models = RunConfig(train=TrainConfig(**train), ppo=PPOConfig(epochs=2))
    assert as_tables == as_models
    assert (as_tables.ppo.advantage, as_tables.ppo.epochs) == (advantage, 2)


@pytest.mark.parametrize(
    ("section", "key", "value", "wanted"),
    [
        ("network", "attention", "inner", "none"),
        ("network", "mask_unavailable", True, False),
        ("network", "encoder", "entities", "flat"),
        ("ppo", "advantage", "counterfactual", "value"),
    ],
)
def test_mappo_refuses_what_contradicts_it(
    section: str, key: str, value: object, wanted: object
) -> None:
    message = f"{section}.{key} = {value!r}: train.method = 'mappo' needs {wanted!r}"
    with pytest.raises(ValidationError, match=re.escape(message)):
        RunConfig.model_validate({"train": {"method": "mappo"}, section: {key: value}})


@pytest.mark.parametrize("method", ["td-inner", "ppo-uniform"])
def test_only_mappo_goes_without_attention(method: str) -> None:
    with pytest.raises(ValidationError, match=rf"network\.attention = 'none'.*'{method}' needs"):
        RunConfig.model_validate({"train": {"method": method}, "network": {"attention": "none"}})


@pytest.mark.parametrize(
    ("section", "key", "value"),
    [
        ("network", "hidden_width", 0),
        ("network", "attention_heads", 0),
        ("network", "encoder", "rows"),
        ("network", "parameter_sharing", "all"),
        ("td", "gamma", 1.5),
        ("td", "gamma", float("nan")),
        ("td", "polyak", 0.0),
        ("td", "reward_scale", 0.0),
        ("td", "learning_rate", -1e-3),
        ("td", "batch_size", 0),
        ("td", "update_every_env_steps", 0),
        ("td", "warmup_env_steps", -1),
        ("td", "critic_grad_clip", float("inf")),
        ("td", "reward_std_floor", 0.0),
        ("ppo", "gae_lambda", 1.5),
        ("ppo", "clip", 1.0),
        ("ppo", "minibatch_size", 0),
        ("imitation", "env_steps", 0),
        ("imitation", "learning_rate", 0.0),
        ("train", "method", "ppo"),
        ("train", "method", ["td-inner"]),
        ("train", "warm_start", "oracle"),
        ("train", "seed", -1),
        ("train", "threads", 0),
        ("train", "num_envs", 0),
        ("train", "env_steps", -1),
        ("evaluate", "episodes", 0),
    ],
)
def test_out_of_range_is_refused(section: str, key: str, value: object) -> None:
    with pytest.raises(ValidationError) as caught:
        RunConfig.model_validate({section: {key: value}})
    assert [error["loc"] for error in caught.value.errors()] == [(section, key)]


@pytest.mark.parametrize(
    ("key", "value", "rule"),
    [
        ("scenario.substeps", True, "must be a valid number"),
        ("scenario.dt_s", "0.1", "must be a valid number"),
        ("scenario.observe_faults", "yes", "must be true or false"),
        ("scenario.observe_faults", 1, "must be true or false"),
        ("train.threads", "2", "must be a valid number"),
        ("td.gamma", False, "must be a valid number"),
        ("scenario.obstacles", [{"shape": "disc", "radius_m": "1"}], "must be a valid number"),
        ("scenario.obstacles", [{"shape": "box", "half_extents_m": [1, "1"]}], "must be valid"),
    ],
)
def test_values_of_another_type_are_refused(key: str, value: object, rule: str) -> None:
    with pytest.raises(ConfigError) as error:
        load_run_config(overrides={key: value})
    assert str(error.value).startswith(key)
    assert f": {rule}" in str(error.value)


@pytest.mark.parametrize("method", ["td-inner", "ppo-inner"])
def test_potential_shaping_goes_with_the_learners_discount(method: str) -> None:
    shaped: dict[str, object] = {"scenario.shaping": "potential", "scenario.shaping_discount": 0.9}
    section = method.partition("-")[0]
    with pytest.raises(ConfigError, match=rf"shaping_discount = 0\.9: .*{section}\.gamma = 0\.9"):
        load_run_config(method=method, overrides=shaped)
    load_run_config(method=method, overrides={**shaped, f"{section}.gamma": 0.9})
    load_run_config(method=method, overrides={"scenario.shaping_discount": 0.9})


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"train.potential": "dispatch"}, "train.potential = 'dispatch': must be 'none', 'random'"),
        (
            {"train.potential_discount": 0.9},
            "train.potential_discount = 0.9: train.potential = 'none' needs None",
        ),
        (
            {"train.schedule": {"potential_weight": {"first": 1.0, "last": 0.0}}},
            "train.schedule.potential_weight: train.potential = 'none' needs None",
        ),
        (
            {"train.potential": "greedy", "train.potential_discount": 1.0},
            "train.potential_discount = 1.0: must be less than 1",
        ),
        (
            {"train.potential": "greedy", "td.gamma": 1.0},
            "train.potential = 'greedy': a potential needs a discount below 1; td.gamma = 1.0",
        ),
        (
            {
                "train.potential": "greedy",
                "train.schedule": {"gamma": {"first": 0.9, "last": 0.95}},
            },
            "train.potential_discount = None: must be given where train.schedule.gamma",
        ),
        (
            {"train.potential": "greedy", "train.potential_env_steps": 999},
            "train.potential_env_steps = 999: must be greater than or equal to 1000",
        ),
    ],
)
def test_potentials_that_make_no_sense_are_refused(values: dict[str, object], message: str) -> None:
    with pytest.raises(ConfigError, match=re.escape(message)):
        load_run_config(overrides=values)


def test_a_potential_has_the_learners_discount_unless_another_is_given() -> None:
    shaped: dict[str, object] = {"train.potential": "hungarian", "td.gamma": 0.9}
    assert load_run_config(overrides=shaped).potential_discount == 0.9
    given = {**shaped, "train.potential_discount": 0.98}
    assert load_run_config(overrides=given).potential_discount == 0.98
    ramp = {"train.schedule": {"gamma": {"first": 0.9, "last": 0.95}}}
    assert load_run_config(overrides={**given, **ramp}).potential_discount == 0.98
    assert load_run_config(overrides=given).digest() != load_run_config(overrides=shaped).digest()


def test_a_fault_begins_within_every_length_that_is_measured() -> None:
    fault = {"robot": "food_0", "kind": "unavailable", "value": 1.0, "onset_step": 100}
    given: dict[str, object] = {"scenario.episode_steps": 200, "scenario.faults": [fault]}
    message = r"faults\[0\]\.onset_step = 100: must be below evaluate\.long_episode_steps = 100"
    with pytest.raises(ConfigError, match=message):
        load_run_config(overrides=given)
    load_run_config(overrides={**given, "evaluate.long_episode_steps": 200})


def test_heads_must_divide_width() -> None:
    with pytest.raises(ValidationError, match=r"network\.hidden_width = 100.*attention_heads = 8"):
        NetworkConfig(hidden_width=100, attention_heads=8)


def test_replay_must_hold_a_batch() -> None:
    with pytest.raises(ValidationError, match=r"td\.replay_capacity = 10.*td\.batch_size = 11"):
        TDConfig(replay_capacity=10, batch_size=11)


def test_every_key_says_what_it_is() -> None:
    for section, info in RunConfig.model_fields.items():
        annotation: Any = info.annotation
        kind = get_args(annotation)[0] if get_args(annotation) else annotation  # or none at all
        for name, key in kind.model_fields.items():
            assert key.description, f"{section}.{name} has no description"


@pytest.mark.parametrize(
    ("method", "warm_start", "unused"),
    [
        ("td-inner", "none", {"ppo", "imitation"}),
        ("td-uniform", "greedy", {"ppo"}),
        ("ppo-inner", "none", {"td", "imitation"}),
        ("mappo", "hungarian", {"td"}),
    ],
)
def test_what_a_run_depends_on(method: str, warm_start: str, unused: set[str]) -> None:
    config = RunConfig.model_validate({"train": {"method": method, "warm_start": warm_start}})
    assert config.in_use().keys() == RunConfig.model_fields.keys() - unused - {"family"}
    assert config.in_use()["scenario"] == config.scenario.model_dump(mode="json")


ADDED_SINCE = {
    "scenario": (
        "victim_area_m",
        "victim_places_m",
        "lost_cost",
        "arrivals",
        "unavailable_robots",
        "stations",
        "depots",
        "end_when_done",
        "map",
        "occlusion",
        "communication",
        "observed_teammates",
        "observed_victims",
    ),
    "network": (
        *("swapped_robots", "shared_gradients", "joint_critic", "symmetry", "memory_width"),
        *("mask_actions", "message_width", "message_pooling", "pooling"),
    ),
    "train": (
        *("episode_steps", "engine", "stagger_starts", "schedule"),
        *("potential", "potential_discount", "potential_env_steps"),
        *("checkpoint_every_env_steps", "checkpoint_every_minutes", "keep_checkpoints"),
        *("keep_best", "on_divergence", "matmul_backend", "workers"),
    ),
}


def test_a_digest_is_that_of_the_values_in_use() -> None:
    config = RunConfig()
    values = config.in_use()
    for section, names in ADDED_SINCE.items():
        for name in names:
            del values[section][name]  # at its default
    for robot in values["scenario"]["robots"]:
        for name in (
            "start_m",
            "battery",
            "load",
            "sight_m",
            "field_of_view_deg",
            "range_sensor",
            "drive",
            "layer",
            "max_turn_rad_s",
        ):
            del robot[name]
        for name in ("acceleration_m_s2", "turn_acceleration_rad_s2", "wheel_base_m"):
            del robot[name]
    for task in values["scenario"]["tasks"]:
        for name in ("service_s", "service", "deadline_s", "after", "arrival_rate_hz", "area_m"):
            del task[name]
    text = json.dumps(values, sort_keys=True, separators=(",", ":"))
    assert config.digest() == hashlib.sha256(text.encode()).hexdigest()
    for unused in ({"ppo": {"epochs": 1}}, {"imitation": {"env_steps": 1}}):
        assert RunConfig(**unused).digest() == config.digest()
    for used in ({"td": {"gamma": 0.5}}, {"train": {"seed": 3}}, {"scenario": {"dt_s": 0.2}}):
        assert RunConfig(**used).digest() != config.digest()


def seeded(seed: int) -> dict[str, object]:
    return {"train.seed": seed, "train.threads": 1, "evaluate.seed": 12_345 + seed}


TEAM_CREDIT: dict[str, object] = {"scenario.rescue_credit": "team"}
PUBLISHED = [  # configurations of runs in docs/records, and what their digests were then
    (("single", "td-inner", "short", seeded(9) | TEAM_CREDIT), "72116b7a620e1e982df071582e264ed1"),
    (("single", "ppo-uniform", "short", seeded(0)), "7ba555e85597dc5945834cce35185e38"),
    (("double", "td-uniform", "short", seeded(2)), "89d64f892e8f4d53bd38b7d2408474ce"),
    (("mixed", "td-inner", "paper", seeded(0)), "85d6cfb65fec94f69a863a4a793d6f39"),
]


@pytest.mark.parametrize(("sources", "digest"), PUBLISHED)
def test_digests_of_published_runs_stay_what_they_were(
    sources: tuple[str, str, str, dict[str, object]], digest: str
) -> None:
    preset, method, budget, overrides = sources
    config = load_run_config(preset, method, budget, overrides=overrides)
    assert config.digest().startswith(digest)


class Part(Model):
    size: int = 1
    added: Annotated[int, ADDED_LATER] = 2


class Whole(Model):
    part: Part = Field(default_factory=Part)
    parts: tuple[Part, ...] = ()
    sizes: tuple[int, ...] = (4, 5)
    added: Annotated[Part, ADDED_LATER] = Field(default_factory=Part)


def test_keys_added_later_count_only_where_they_are_not_at_their_default() -> None:
    old = {"part": {"size": 1}, "parts": [{"size": 3}], "sizes": [4, 5]}
    assert values_for_digest(Whole(parts=(Part(size=3),))) == old
    changed = Whole(part=Part(added=7), parts=(Part(added=8),), added=Part(size=9))
    assert values_for_digest(changed) == {
        "part": {"size": 1, "added": 7},
        "parts": [{"size": 1, "added": 8}],
        "sizes": [4, 5],
        "added": {"size": 9},
    }


def test_a_key_added_later_changes_the_digest_of_a_run_that_uses_it() -> None:
    config = RunConfig(network=NetworkConfig(shared_gradients="mean"))
    assert config.digest() != RunConfig().digest()
    assert "shared_gradients" in RunConfig().in_use()["network"]


def with_value_clip(method: str, value: object) -> dict[str, object]:
    return {"train": {"method": method}, "ppo": {"epochs": 3, "value_clip": value}}


@pytest.mark.parametrize(
    ("method", "value"), [("ppo-inner", None), ("mappo", None), ("td-inner", None), ("td-inner", 1)]
)
def test_a_removed_key_that_changed_nothing_is_passed_over(method: str, value: object) -> None:
    config = RunConfig.model_validate(with_value_clip(method, value))
    assert config == RunConfig.model_validate({"train": {"method": method}, "ppo": {"epochs": 3}})
    assert "value_clip" not in config.model_dump()["ppo"]


def test_a_removed_key_that_a_run_used_is_refused(tmp_path: Path) -> None:
    message = "ppo.value_clip = 0.5: must be left out, because it was removed; a run that used it "
    with pytest.raises(ValidationError, match=re.escape(message)):
        RunConfig.model_validate(with_value_clip("ppo-inner", 0.5))
    stored = tmp_path / "config.toml"
    stored.write_text('[train]\nmethod = "mappo"\n[ppo]\nadvantage = "value"\nvalue_clip = 0.5\n')
    with pytest.raises(ConfigError) as caught:
        read_toml(stored)
    assert str(caught.value).startswith(f"{stored}: {message}needs an earlier version")
    assert "\n" not in str(caught.value)


def test_a_removed_key_stays_in_digests() -> None:
    values = values_for_digest(PPOConfig())
    assert values["value_clip"] is None
    assert set(values) == {*PPOConfig.model_fields, "value_clip"} - {
        "bootstrap",
        "afterstate_epochs",
        "sequence_steps",
    }


CONTINUOUS = {"actions": "continuous"}


@pytest.mark.parametrize("method", ["ppo-inner", "ppo-uniform", "mappo"])
def test_the_value_head_follows_continuous_actions(method: str) -> None:
    train = {"method": method}
    given = RunConfig.model_validate({"scenario": CONTINUOUS, "train": train})
    assert given.ppo.advantage == "value"
    as_models = RunConfig(scenario=Scenario(**CONTINUOUS), train=TrainConfig(**train))
    assert as_models == given
    assert given.ppo.replace(advantage="counterfactual") == PPOConfig()


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (
            {"train": {"method": "td-uniform"}},
            "scenario.actions = 'continuous': train.method = 'td-uniform' learns 'discrete' "
            "actions only; methods for continuous ones are ",
        ),
        (
            {"train": {"method": "ppo-inner"}, "ppo": {"advantage": "counterfactual"}},
            "ppo.advantage = 'counterfactual': scenario.actions = 'continuous' needs 'value'",
        ),
        (
            {"train": {"method": "mappo", "warm_start": "hungarian"}},
            "train.warm_start = 'hungarian': scenario.actions = 'continuous' needs 'none'",
        ),
    ],
)
def test_what_learns_discrete_actions_only_is_refused(
    values: dict[str, dict[str, str]], message: str
) -> None:
    with pytest.raises(ValidationError, match=re.escape(message)):
        RunConfig.model_validate({"scenario": CONTINUOUS, **values})
    RunConfig.model_validate(values)
