"""A team as the numbers of a page: which it takes, and what it refuses."""

from pathlib import Path

import pytest
from fresh_run import make_run, run_config

from innerattn.config import Scenario
from innerattn.errors import ConfigError, RunError
from innerattn.report.page.page import page_document
from innerattn.report.page.team import read_team
from innerattn.zoo import zoo_names


def test_every_team_of_the_zoo_is_taken() -> None:
    for name in zoo_names():
        team = read_team(f"zoo:{name}")
        assert team.document["heads"] == (0 if name == "any" else 4)
        assert len(team.document["rows"]) == team.config.scenario.num_robots
        assert team.weights.dtype == "float32"


@pytest.mark.parametrize(
    ("method", "values", "said"),
    [
        ("td-inner", {"network.encoder": "entities"}, "network.encoder = 'entities'"),
        ("ppo-inner", {"network.memory_width": 8}, "network.memory_width = 8"),
        ("ppo-inner", {"network.message_width": 4}, "network.message_width = 4"),
        ("ppo-inner", {"scenario.actions": "continuous"}, "scenario.actions = 'continuous'"),
    ],
)
def test_what_a_page_cannot_compute_is_refused(
    tmp_path: Path, method: str, values: dict[str, object], said: str
) -> None:
    run = make_run(tmp_path / "run", run_config(method, **values))
    with pytest.raises(RunError) as caught:
        read_team(run)
    assert str(caught.value) == f"{run}: a page cannot play it: {said}; innerattn play can"


def test_other_worlds_and_scripts_are_refused() -> None:
    with pytest.raises(RunError, match="zoo:mixed: was trained for other observations"):
        read_team("zoo:mixed", Scenario.preset("mixed-8"))
    with pytest.raises(ConfigError, match="oracle: a page has no such script here; must be random"):
        page_document(Scenario.preset("mixed"), {"oracle": None}, 1)


def test_damaged_weights_are_refused(tmp_path: Path) -> None:
    run = make_run(tmp_path / "run", run_config("td-inner"))
    (weights,) = (run / "checkpoints").rglob("weights.safetensors")
    weights.write_bytes(weights.read_bytes()[:100])
    with pytest.raises(RunError):
        read_team(run)
