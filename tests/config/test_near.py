"""The word that was meant."""

from pathlib import Path

import pytest

from innerattn.config import Scenario, load_run_config
from innerattn.config.near import did_you_mean, nearest
from innerattn.errors import ConfigError


@pytest.mark.parametrize(
    ("word", "found"),
    [
        ("mxied", "mixed"),
        ("MIXED-8", "mixed-8"),
        ("sing", "single"),
        ("situation", None),
        ("", None),
    ],
)
def test_the_nearest_word(word: str, found: str | None) -> None:
    assert nearest(word, ["double", "mixed", "mixed-8", "single"]) == found


def test_nothing_is_said_where_nothing_is_near() -> None:
    assert did_you_mean("colour", ["situation", "robots"]) == ""
    assert did_you_mean("episode-steps", ["episode_steps"]) == ", did you mean episode_steps?"


@pytest.mark.parametrize(
    ("fields", "end"),
    [
        ({"situaton": "mixed"}, "scenario.situaton: unknown key, did you mean situation?"),
        ({"situation": "mxied"}, "'poisson' or 'listed', did you mean 'mixed'?"),
        (
            {"faults": [{"robot": "food_0", "kind": "blackot", "value": 1.0}]},
            "'lost_communication', did you mean 'blackout'?",
        ),
        (
            {"tasks": [{"name": "a", "needs": ["food"], "need": ["food"]}]},
            "scenario.tasks[0].need: unknown key, did you mean needs?",
        ),
    ],
)
def test_a_scenario_says_what_was_meant(fields: dict[str, object], end: str) -> None:
    with pytest.raises(ConfigError) as error:
        Scenario().replace(**fields)
    assert str(error.value).endswith(end)


@pytest.mark.parametrize(
    ("key", "told"),
    [
        ("train.gamma", "train.gamma: unknown key, did you mean td.gamma or ppo.gamma?"),
        ("trian.seed", "trian: unknown key, did you mean train?"),
        ("train.sede", "train.sede: unknown key, did you mean seed?"),
    ],
)
def test_a_run_says_what_was_meant(key: str, told: str) -> None:
    with pytest.raises(ConfigError) as error:
        load_run_config(overrides={key: 1})
    assert str(error.value) == told


@pytest.mark.parametrize(
    ("key", "meant"),
    [
        ("situaton", ", did you mean scenario.situation?"),
        ("gamma", ", did you mean td.gamma or ppo.gamma?"),
        ("scenaro", ", did you mean scenario?"),
        ("xyzzy", ""),
    ],
)
def test_a_key_outside_sections_says_what_was_meant(key: str, meant: str, tmp_path: Path) -> None:
    file = tmp_path / "run.toml"
    file.write_text(f"{key} = 1\n")
    with pytest.raises(ConfigError) as error:
        load_run_config(config_file=file)
    assert str(error.value) == f"{file}: {key}: unknown key{meant}"


def test_unknown_presets_say_what_was_meant() -> None:
    with pytest.raises(ConfigError, match=r"single, did you mean 'double'\?$"):
        Scenario.preset("doubel")


@pytest.mark.parametrize(("need", "meant"), [("water", ""), ("foood", ", did you mean 'food'?")])
def test_a_need_of_nobody_is_named(need: str, meant: str) -> None:
    task = {"name": "flood", "needs": ["food", need]}
    with pytest.raises(ConfigError) as error:
        Scenario().replace(tasks=[task])
    assert str(error.value) == (
        f"scenario.tasks[0].needs: task 'flood' needs {need!r}, which no robot of the team can do; "
        f"abilities of the team are food, information, medicine{meant}"
    )


def test_a_team_without_any_ability_is_said_to_have_none() -> None:
    robots = [one.replace(abilities=()) for one in Scenario().robots]
    with pytest.raises(ConfigError, match=r"abilities of the team are none$"):
        Scenario().replace(robots=robots)


def test_too_few_robots_for_a_need_are_told_as_before() -> None:
    with pytest.raises(ConfigError, match="the team has no distinct able robot for each need"):
        Scenario().replace(tasks=[{"name": "flood", "needs": ["food"] * 3}])


def test_a_file_in_place_of_a_preset_is_told_how_files_are_read() -> None:
    with pytest.raises(ConfigError, match=r"single; Scenario\.from_toml reads a file$"):
        Scenario.preset("mixed.toml")
