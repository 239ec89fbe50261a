"""Sources of a configuration, their order, and TOML there and back."""

from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from innerattn.config import (
    BUDGETS,
    SCENARIOS,
    EvaluateConfig,
    NetworkConfig,
    RunConfig,
    Scenario,
    TDConfig,
    TrainConfig,
    load_run_config,
    read_toml,
    write_toml,
)
from innerattn.errors import ConfigError

PAPER = {
    "scenario.episode_steps": 25,
    "network.hidden_width": 128,
    "network.attention_heads": 4,
    "td.gamma": 0.99,
    "td.polyak": 0.001,
    "td.reward_scale": 100.0,
    "td.learning_rate": 0.001,
    "td.final_learning_rate_share": 1.0,
    "td.batch_size": 1024,
    "td.update_every_env_steps": 100 // 4,
    "td.replay_capacity": 1_000_000,
    "td.attention_logit_penalty": 0.001,
    "td.critic_weight_decay": 0.001,
    "td.critic_grad_clip": 40.0,
    "td.actor_grad_clip": 0.5,
    "td.entropy_target": "maac",
    "train.num_envs": 12,
    "train.env_steps": 25_000 * 25,
    "evaluate.episodes": 80,
}


def value(config: RunConfig, key: str) -> Any:
    section, name = key.split(".")
    return getattr(getattr(config, section), name)


@pytest.mark.parametrize("key", PAPER)
@pytest.mark.parametrize("preset", SCENARIOS)
def test_paper_budget_is_the_papers(preset: str, key: str) -> None:
    assert value(load_run_config(preset, budget="paper"), key) == PAPER[key]


def test_budgets_differ_in_length() -> None:
    steps = {budget: load_run_config(budget=budget).train.env_steps for budget in BUDGETS}
    assert set(steps) == {"quick", "short", "paper", "fast", "strong"}
    assert steps["quick"] < steps["short"] < steps["paper"]
    assert steps["fast"] < steps["strong"]


@pytest.mark.parametrize("method", ["td-inner", "td-uniform", "mappo"])
@pytest.mark.parametrize("budget", BUDGETS)
@pytest.mark.parametrize("preset", SCENARIOS)
def test_every_combination_loads_and_round_trips(
    tmp_path: Path, preset: str, budget: str, method: str
) -> None:
    config = load_run_config(preset, method, budget)
    assert config.scenario == Scenario.preset(preset)
    assert config.train.method == method
    write_toml(config, tmp_path / "config.toml")
    assert read_toml(tmp_path / "config.toml") == config


@pytest.mark.parametrize("budget", BUDGETS)
def test_budgets_of_ppo_are_for_every_on_policy_method(budget: str) -> None:
    configs = [load_run_config(method=method, budget=budget) for method in ("ppo-inner", "mappo")]
    for config in configs:
        strong = budget in ("fast", "strong")
        assert config.train.num_envs == (1_024 if strong else 256)
        assert config.ppo.gamma == (0.98 if strong else 0.99 if budget == "paper" else 0.95)
        assert (config.network.symmetry == "canonical") == strong
        assert config.train.env_steps == configs[0].train.env_steps


@pytest.mark.parametrize("budget", BUDGETS)
def test_a_warm_start_has_numbers_of_its_own_for_ppo_alone(budget: str) -> None:
    def changed(method: str) -> set[str]:
        cold, warm = (
            load_run_config("double", method, budget, overrides={"train.warm_start": script})
            for script in ("none", "hungarian")
        )
        before, after = cold.model_dump(), warm.model_dump()
        return {
            f"{section}.{key}"
            for section, table in before.items()
            for key in table or ()
            if table[key] != after[section][key]
        }

    assert changed("td-inner") == {"train.warm_start"}
    assert changed("ppo-inner") > {"train.warm_start"}


def test_a_file_may_choose_a_warm_start(tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text("[train]\nmethod = 'ppo-inner'\nwarm_start = 'greedy'\n")
    given = {"train.warm_start": "greedy"}
    assert load_run_config(config_file=file) == load_run_config(method="ppo-inner", overrides=given)


def test_later_sources_win(tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text("[td]\ngamma = 0.5\nbatch_size = 7\n[train]\nmethod = 'td-uniform'\n")
    config = load_run_config("single", "td-inner", "paper", file, {"td.batch_size": 8})
    assert config.td.learning_rate == 0.001  # budget
    assert (config.td.gamma, config.train.method) == (0.5, "td-uniform")  # file
    assert config.td.batch_size == 8  # single value
    assert config.network.attention == "uniform"
    assert config.scenario.situation == "single"


def test_what_is_wrong_in_a_file_names_the_file(tmp_path: Path) -> None:
    path = tmp_path / "wrong.toml"
    path.write_text("[td]\ngama = 0.9\n")
    for overrides in (None, {"td.batch_size": 64}):
        with pytest.raises(ConfigError) as error:
            load_run_config(config_file=path, overrides=overrides)
        assert str(error.value) == f"{path}: td.gama: unknown key, did you mean gamma?"
    path.write_text("[td]\ngamma = 0.9\n")
    with pytest.raises(ConfigError) as error:
        load_run_config(config_file=path, overrides={"td.gama": 0.9})
    assert str(error.value) == "td.gama: unknown key, did you mean gamma?"


def test_a_scenarios_file_is_not_a_runs_and_is_told(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text('situation = "double"')
    with pytest.raises(ConfigError) as error:
        load_run_config(config_file=path)
    told = "situation: unknown key; a scenario's stand in [scenario], or in a file for --scenario"
    assert str(error.value) == f"{path}: {told}"


@pytest.mark.parametrize("head", ["", "[scenario]\n"])
def test_a_file_is_the_scenario_of_a_run(tmp_path: Path, head: str) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(f'{head}situation = "double"\nepisode_steps = 40\n')
    scenario = Scenario(situation="double", episode_steps=40)
    assert Scenario.from_toml(path) == scenario
    config = load_run_config("mixed-faults", "ppo-inner", "fast", scenario_file=path)
    assert config.scenario == scenario
    assert config.train == load_run_config("double", "ppo-inner", "fast").train
    single = {"scenario.episode_steps": 41}
    config = load_run_config(scenario_file=path, overrides=single)
    assert config.scenario == scenario.replace(episode_steps=41)


def test_the_configuration_of_a_run_is_a_scenarios_file(tmp_path: Path) -> None:
    path, config = tmp_path / "config.toml", load_run_config("mixed-faults")
    write_toml(config, path)
    assert Scenario.from_toml(path) == config.scenario


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("dt_s = 0.2\n[scenario]\nsituation = 'single'", "dt_s: must stand in [scenario], as the"),
        ("[scenario]\ndt_s = -1", "scenario.dt_s = -1: must be"),
        ("colour = 1", "scenario.colour: unknown key"),
    ],
)
def test_what_is_wrong_in_a_scenarios_file_names_it(tmp_path: Path, text: str, told: str) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(text)
    for load in (Scenario.from_toml, lambda file: load_run_config(scenario_file=file)):
        with pytest.raises(ConfigError) as error:
            load(path)
        assert str(error.value).startswith(f"{path}: {told}")


def test_tables_in_a_file_replace_lists(tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text("[[scenario.tasks]]\nname = 'only'\nneeds = ['food', 'food']\n")
    config = load_run_config(config_file=file)
    assert [task.name for task in config.scenario.tasks] == ["only"]
    assert len(config.scenario.robots) == 4


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        ({"td.gama": 0.9}, r"^td\.gama: unknown key, did you mean gamma\?$"),
        ({"tdd.gamma": 0.9}, r"^tdd: unknown key, did you mean td\?$"),
        ({"gamma": 0.9}, r"^gamma: unknown key"),
        ({"td.gamma": 2}, r"^td\.gamma = 2: must be less than or equal to 1$"),
        ({"scenario.colour": 1}, r"^scenario\.colour: unknown key$"),
        ({"scenario.episode_steps": 0}, r"^scenario\.episode_steps = 0: must be"),
        ({"network.encoder": "rows"}, r"^network\.encoder = 'rows': must be 'flat' or 'entities'$"),
        (
            {"network.pooling": "max"},
            r"^network\.pooling = 'max': network\.encoder = 'flat' pools nothing; must be "
            r"'attention', or the encoder 'entities'$",
        ),
        (
            {"network.pooling": "sum", "network.encoder": "entities"},
            r"^network\.pooling = 'sum': must be 'attention', 'mean', 'max' or 'nearest'$",
        ),
        (
            {"network.swapped_robots": ("food_0", "medical_0")},
            "must be two robots of a kind, of food",
        ),
        ({"network.swapped_robots": ("food_1", "food_1")}, "must be two robots of a kind, of food"),
        ({"network.swapped_robots": ("food_2", "food_2")}, "must be two robots of a kind, of food"),
        ({"network.swapped_robots": ("food_0", "food")}, "must be two robots of a kind, of food"),
        (
            {
                "network.swapped_robots": ("food_0", "food_1"),
                "network.parameter_sharing": "kind",
            },
            r"^network\.swapped_robots = \['food_0', 'food_1'\]: network",
        ),
        ({"network.attention": "uniform"}, r"^network\.attention = 'uniform': train\.method"),
    ],
)
def test_wrong_values_are_named(overrides: dict[str, object], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        load_run_config(overrides=overrides)


def test_unknown_sources_are_named() -> None:
    with pytest.raises(
        ConfigError, match=r"'triple': known are air-ground, double, mixed, .*single"
    ):
        load_run_config("triple")
    with pytest.raises(ConfigError, match=r"'long': known are fast, paper, quick, short, strong"):
        load_run_config(budget="long")
    with pytest.raises(ConfigError, match=r"train\.method = 'ppo'"):
        load_run_config(method="ppo")


def test_a_section_must_be_a_table(tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text("td = 3\n")
    with pytest.raises(ConfigError, match=r"mine\.toml: td = 3: "):
        load_run_config(config_file=file)


def test_failed_write_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "config.toml"
    write_toml(load_run_config(), file)
    before = file.read_bytes()

    def full_disk(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full_disk)
    with pytest.raises(OSError, match="No space left"):
        write_toml(load_run_config(budget="paper"), file)
    assert file.read_bytes() == before
    assert list(tmp_path.iterdir()) == [file]


def positive(limit: float) -> st.SearchStrategy[float]:
    return st.floats(0.0, limit, exclude_min=True, allow_nan=False)


CONFIGS = st.builds(
    RunConfig,
    scenario=st.builds(
        Scenario,
        situation=st.sampled_from(["single", "double", "mixed"]),
        max_victims=st.integers(1, 4),
        episode_steps=st.integers(1, 1000),
        end_when_rescued=st.none() | st.integers(1, 10),
        damping=st.floats(0.0, 0.9),
        rescue_credit=st.sampled_from(["helpers", "team"]),
        shaping_weight=st.floats(0.0, 10.0),
    ),
    network=st.builds(
        NetworkConfig,
        hidden_width=st.sampled_from([4, 64]),
        mask_unavailable=st.booleans(),
        encoder=st.sampled_from(["flat", "entities"]),
        parameter_sharing=st.sampled_from(["none", "kind"]),
    ),
    td=st.builds(
        TDConfig,
        gamma=st.floats(0.0, 1.0),
        polyak=positive(1.0),
        learning_rate=positive(1.0),
        reward_scale=positive(1e300),
        critic_weight_decay=st.floats(0.0, 1e-300),
        warmup_env_steps=st.integers(0, 10**12),
    ),
    train=st.builds(
        TrainConfig,
        seed=st.integers(0, 2**63 - 1),
        device=st.text(st.characters(exclude_categories=["Cs"])),
        threads=st.none() | st.integers(1, 64),
    ),
    evaluate=st.builds(EvaluateConfig, seed=st.integers(0, 2**63 - 1)),
)


@given(CONFIGS)
def test_toml_round_trip_is_exact(
    tmp_path_factory: pytest.TempPathFactory, config: RunConfig
) -> None:
    file = tmp_path_factory.getbasetemp() / "round_trip.toml"
    write_toml(config, file)
    assert read_toml(file) == config
