"""A team as the numbers of a page: which it takes, and what it refuses."""

import json
from contextlib import closing
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest
from fresh_run import make_run, run_config
from sensing import sensing

from innerattn.config import Scenario
from innerattn.config.communication import Communication
from innerattn.config.files import preset_names
from innerattn.envs import BatchEnv
from innerattn.errors import ConfigError, RunError
from innerattn.report.page.page import page_document
from innerattn.report.page.team import read_team
from innerattn.train import RunFolder
from innerattn.train.build import build_learner
from innerattn.train.columns import hearing
from innerattn.zoo import zoo_names


def test_every_team_of_the_zoo_is_taken() -> None:
    for name in zoo_names():
        team = read_team(f"zoo:{name}")
        assert team.document["heads"] == (0 if name == "any" else 4)
        assert len(team.document["rows"]) == team.config.scenario.num_robots
        assert team.weights.dtype == "float32"


@pytest.mark.parametrize(
    ("method", "values"),
    [
        ("td-inner", {"network.encoder": "entities"}),
        ("ppo-inner", {"network.memory_width": 8}),
        ("ppo-inner", {"network.message_width": 4}),
        ("ppo-inner", {"network.mask_actions": True}),
        ("ppo-inner", {"scenario.actions": "continuous"}),
        ("mappo", {"network.memory_width": 8, "network.message_width": 4}),
    ],
)
def test_networks_of_all_sorts_are_taken(
    tmp_path: Path, method: str, values: dict[str, object]
) -> None:
    team = read_team(make_run(tmp_path / "run", run_config(method, **values)))
    places = team.document["tensors"].values()
    assert sum(int(np.prod(one["shape"])) for one in places) == len(team.weights)


def test_other_delays_of_messages_are_refused(tmp_path: Path) -> None:
    soon, late = (
        Scenario.preset("mixed").replace(communication=Communication(delay_steps=steps))
        for steps in (1, 2)
    )
    config = run_config("ppo-inner", **{"network.message_width": 4})
    run = make_run(tmp_path / "run", config.model_copy(update={"scenario": soon}))
    assert read_team(run, soon).document["hearing"]["delay"] == 1
    with pytest.raises(RunError) as caught:
        read_team(run, late)
    assert str(caught.value) == (
        f"{run}: was trained with communication.delay_steps = 1: must be 1 here, not 2, because "
        "its robots have messages"
    )


@pytest.mark.parametrize("name", [*preset_names("scenarios"), "sensing"])
def test_it_knows_whom_robots_hear(tmp_path: Path, name: str) -> None:
    scenario = sensing() if name == "sensing" else Scenario.preset(name)
    config = run_config("ppo-inner", **{"network.message_width": 4})
    run = make_run(tmp_path / "run", config.model_copy(update={"scenario": scenario}))
    with closing(BatchEnv(scenario, 1, num_threads=1)) as env:
        expected = asdict(hearing(env.observation_names(), scenario.message_delay_steps))
    found = read_team(run).document["hearing"]
    assert found.pop("pooling") == "attention"
    assert json.loads(json.dumps(found)) == json.loads(json.dumps(expected))


def test_other_worlds_and_scripts_are_refused() -> None:
    with pytest.raises(RunError, match="zoo:mixed: was trained for other observations"):
        read_team("zoo:mixed", Scenario.preset("mixed-8"))
    with pytest.raises(ConfigError, match="oracle: a page has no such script here; must be random"):
        page_document(Scenario.preset("mixed"), {"oracle": None}, 1)


def test_weights_of_another_network_are_refused(tmp_path: Path) -> None:
    config, other = (
        run_config("ppo-inner", **{"network.memory_width": width}) for width in (12, 8)
    )
    run = RunFolder.create(tmp_path / "run", config, threads=1)
    with closing(BatchEnv(other.scenario, 1, num_threads=1)) as env:
        run.save_weights(build_learner(other, env).state(), 0)
    run.mark("done", 0, 0, 0.0)
    said = r"its weights: actor\.first\.weight has shape .*, must have \(4, 8, "
    with pytest.raises(RunError, match=said):
        read_team(tmp_path / "run")


def test_damaged_weights_are_refused(tmp_path: Path) -> None:
    run = make_run(tmp_path / "run", run_config("td-inner"))
    (weights,) = (run / "checkpoints").rglob("weights.safetensors")
    weights.write_bytes(weights.read_bytes()[:100])
    with pytest.raises(RunError):
        read_team(run)
