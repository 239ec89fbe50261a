"""Exports of policies for any team: what is written, how it is checked, what is refused."""

import json
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
import torch
from fresh_run import make_run, run_config
from team_of_any import TEAM, config_of

from innerattn.config import Battery, RangeSensor, Scenario, load_run_config
from innerattn.envs import BatchEnv
from innerattn.errors import ConfigError, ExportError
from innerattn.evaluate import load_trained
from innerattn.policies import Exported, PolicyInput
from innerattn.report.page.team import read_team
from innerattn.train.export import export_run
from innerattn.train.export.check import check_pairs
from innerattn.train.policy import load_policy
from innerattn.train.teams.policy import TeamPolicy
from innerattn.zoo import run_path


def loaded() -> TeamPolicy:
    _, policy = load_policy(run_path("zoo:any"), scenario=TEAM)
    assert isinstance(policy, TeamPolicy)
    return policy


def test_the_folder_has_a_contract_weights_and_one_file_for_any_team(any_team: Path) -> None:
    folder = any_team / "export"
    names = {path.name for path in folder.iterdir()}
    assert names == {"contract.json", "weights.safetensors", "any.onnx"}
    contract = Exported(folder).contract
    assert contract.actors == {"any": "any.onnx"}
    assert {robot.actor for robot in contract.robots} == {"any"}
    assert [robot.name for robot in contract.robots] == [robot.name for robot in TEAM.robots]
    assert [robot.mass_kg for robot in contract.robots] == [robot.mass_kg for robot in TEAM.robots]
    assert contract.network.pooling == "attention"
    assert contract.network.pairs is not None
    assert contract.network.pairs.rescue_radius_m == TEAM.rescue_radius_m
    assert contract.run["method"] == "team-inner"
    assert set(contract.made_with) == {"innerattn", "torch", "onnx", "onnxscript"}
    checked = contract.checked
    assert checked is not None
    assert checked.observations >= 10_000
    assert checked.same_greedy_action + checked.near_ties == checked.observations
    assert checked.largest_difference_onnx is not None
    assert 0.0 < checked.largest_difference_onnx < 1e-4
    assert 0.0 < checked.largest_difference_numpy < 1e-4
    said = " ".join(contract.about.values())
    assert "ONNX file" in contract.about["any_team"]
    assert "The ONNX files take" not in said


def test_it_plays_as_the_trained_policy(any_team: Path) -> None:
    """Where no sense fails, one table of a world serves all robots of the learner."""
    team, policy = Exported(any_team / "export"), loaded()
    same, taken = [], set()
    with closing(BatchEnv(TEAM, 16, seed=9, num_threads=1)) as env:
        obs = env.reset()
        for _ in range(30):
            actions = policy.act(torch.tensor(obs), greedy=True).numpy()
            same.append(team.act(PolicyInput(obs)) == actions)
            taken |= set(actions.ravel().tolist())
            obs = env.step(actions).obs
    assert len(taken) == 5
    assert np.mean(same) > 0.999


def test_what_differs_is_refused(any_team: Path) -> None:
    """The check compares with the learner, not with the export itself."""
    policy, team = loaded(), Exported(any_team / "export")
    with torch.no_grad():
        policy.actor.out.bias[1] += 0.01
    with pytest.raises(ExportError, match=r"^\w+: the exported policy \(numpy\) differs from"):
        check_pairs(TEAM, policy, team)


def without_bodies(folder: Path, bodies: str) -> Path:
    """A run whose policy does not see bodies."""
    config = load_run_config(
        method="team-inner",
        overrides={"team.features": "plain", "team.bodies": bodies, "team.hidden_width": 24},
    )
    return make_run(folder, config)


@pytest.fixture
def without_onnx(monkeypatch: pytest.MonkeyPatch) -> None:
    """As where no library of ONNX is installed; with them an export takes long."""
    monkeypatch.setattr("innerattn.train.export.write.find_spec", lambda _: None)


@pytest.mark.usefixtures("without_onnx")
def test_what_a_policy_does_not_see_needs_no_mask_in_an_export(tmp_path: Path) -> None:
    _, contract = export_run(without_bodies(tmp_path / "run", "hidden"))
    assert contract.checked is not None
    assert contract.checked.largest_difference_numpy < 1e-4


def test_a_hypernetwork_is_not_exported(tmp_path: Path) -> None:
    run = without_bodies(tmp_path / "run", "hypernetwork")
    for made in (lambda: export_run(run), lambda: read_team(run)):
        with pytest.raises(ConfigError, match=r"team\.bodies = 'hypernetwork': such a policy acts"):
            made()
    assert not (run / "export").exists()
    _, policy = load_trained(run, TEAM)
    with closing(BatchEnv(TEAM, 3, seed=9, num_threads=1)) as env:
        assert policy.act(PolicyInput(env.reset())).shape == (3, len(TEAM.robots))


@pytest.mark.usefixtures("without_onnx")
def test_without_a_scenario_it_is_that_of_the_run(tmp_path: Path) -> None:
    run = make_run(tmp_path / "run", config_of("nearest", Scenario.preset("mixed"), 1))
    folder, contract = export_run(run)
    assert folder == run / "export"
    assert [robot.name for robot in contract.robots] == [one.name for one in Scenario().robots]
    assert contract.network.pooling == "nearest"
    document = json.loads((folder / "contract.json").read_text())
    assert document["run"]["method"] == "team-nearest"


@pytest.mark.usefixtures("without_onnx")
def test_no_library_of_onnx_is_needed(tmp_path: Path) -> None:
    run = make_run(tmp_path / "run", config_of("max", Scenario.preset("mixed"), 1))
    folder, contract = export_run(run)
    assert contract.actors == {"any": "weights.safetensors"}
    assert set(contract.made_with) == {"innerattn", "torch"}
    assert contract.checked is not None
    assert contract.checked.largest_difference_onnx is None
    assert Exported(folder).backend == "numpy"
    with pytest.raises(ExportError, match=r"backend = 'onnxruntime': must be 'numpy' or None; th"):
        Exported(folder, backend="onnxruntime")


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (
            {"battery": Battery(capacity_j=5.0, idle_w=1.0)},
            "battery.capacity_j = 5: there must be no battery",
        ),
        ({"load": 2}, "load = 2: there must be no load; policies for any team see no loads"),
        ({"drive": "velocity"}, "drive = 'velocity': must be 'force'; policies for any team set"),
        ({"sight_m": 0.5}, "sight_m = 0.5: must be left out; policies for any team see everything"),
        ({"range_sensor": RangeSensor(rays=3, range_m=1.0)}, "rays = 3: there must be no range"),
    ],
)
def test_what_the_policy_cannot_know_is_refused(
    tmp_path: Path, change: dict[str, object], said: str
) -> None:
    first, *others = TEAM.robots
    known = (
        {"stations": [{"position_m": [0.5, 0.0], "recharge_w": 1.0}]} if "battery" in change else {}
    )
    known |= {"depots": [{"position_m": [0.5, 0.0]}]} if "load" in change else {}
    scenario = TEAM.replace(robots=[first.replace(**change), *others], **known)
    with pytest.raises(ConfigError, match=said) as caught:
        export_run(run_path("zoo:any"), tmp_path / "export", scenario)
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "export").exists()


def test_a_policy_of_one_team_takes_no_other_scenario(tmp_path: Path) -> None:
    run = make_run(tmp_path / "run", run_config("td-inner"))
    with pytest.raises(ExportError, match=r"method 'td-inner' is of one team: it cannot be export"):
        export_run(run, tmp_path / "export", TEAM)
    assert not (tmp_path / "export").exists()
