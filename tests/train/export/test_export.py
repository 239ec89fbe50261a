"""What `innerattn export` writes, how it checks that, and what it refuses."""

import errno
import json
import os
from contextlib import closing
from hashlib import sha256
from pathlib import Path

import numpy as np
import onnx
import pytest
import torch
from fresh_run import make_run, run_config
from made_export import FRAMED, made_export

from innerattn.config import Battery, RangeSensor, Scenario
from innerattn.envs import BatchEnv
from innerattn.errors import ExportError, RunError
from innerattn.policies import Exported, PolicyInput
from innerattn.records.run_files import RunFiles
from innerattn.train import load_policy
from innerattn.train.export import export_run
from innerattn.train.export.actors import inner_actor
from innerattn.train.export.check import check_export

Made = tuple[Path, Path]


@pytest.fixture
def framed(framed_team: Path) -> Made:
    """PPO in canonical frames, parameters shared by kind, entities encoded one by one."""
    return framed_team / "run", framed_team / "export"


@pytest.fixture(scope="module")
def central(tmp_path_factory: pytest.TempPathFactory) -> Made:
    """Flat MAPPO in canonical frames, one actor for each robot."""
    values = {"network.symmetry": "canonical"}
    return made_export(tmp_path_factory.mktemp("central"), "mappo", **values)


@pytest.mark.long
@pytest.mark.parametrize("made", ["framed", "central"])
def test_an_exported_team_plays_as_the_trained_one(
    request: pytest.FixtureRequest, made: str
) -> None:
    run, folder = request.getfixturevalue(made)
    config, learner = load_policy(run)
    teams = [Exported(folder, backend=one, greedy=True) for one in ("numpy", "onnxruntime")]
    with closing(BatchEnv(config.scenario, 64, seed=9, num_threads=1)) as env:
        obs = env.reset()
        taken = []
        for _ in range(30):
            actions = learner.act(torch.tensor(obs), greedy=True).numpy()
            for team in teams:
                np.testing.assert_array_equal(team.act(PolicyInput(obs)), actions)
            taken.append(actions)
            obs = env.step(actions).obs
    assert len(np.unique(taken)) > 2


@pytest.mark.long
@pytest.mark.parametrize("values", [FRAMED, {}], ids=["framed", "plain"])
def test_a_team_of_forces_plays_as_the_trained_one(
    tmp_path: Path, values: dict[str, object]
) -> None:
    run, folder = made_export(tmp_path, "ppo-inner", **{"scenario.actions": "continuous"}, **values)
    config, learner = load_policy(run)
    teams = [Exported(folder, backend=one, greedy=True) for one in ("numpy", "onnxruntime")]
    contract = teams[0].contract
    assert (contract.action_kind, contract.actions, contract.outputs) == ("continuous", (), 4)
    assert contract.checked is not None
    assert contract.checked.same_greedy_action == contract.checked.observations
    assert (contract.network.frame is None) == (not values)
    with closing(BatchEnv(config.scenario, 64, seed=9, num_threads=1)) as env:
        obs = env.reset()
        taken = []
        for _ in range(30):
            forces = learner.act(torch.tensor(obs), greedy=True).numpy()
            for team in teams:
                found = team.act(PolicyInput(obs))
                assert found.dtype == np.float32
                np.testing.assert_allclose(found, forces, atol=1e-5)
            taken.append(forces)
            obs = env.step(forces).obs
    assert len(np.unique(np.sign(taken).reshape(-1, 2), axis=0)) == 4
    for team in teams:
        decision = team.decide("food_1", obs[0, 1])
        assert (decision.action, len(decision.probabilities)) == (None, 0)
        np.testing.assert_allclose(decision.force, team.act(PolicyInput(obs[:1]))[0, 1], atol=1e-6)


@pytest.mark.long
def test_forces_are_drawn_as_in_training(tmp_path: Path) -> None:
    run, folder = made_export(
        tmp_path, "mappo", **{"scenario.actions": "continuous", "network.symmetry": "canonical"}
    )
    config, learner = load_policy(run)
    team = Exported(folder, backend="numpy", greedy=False, seed=3)
    with closing(BatchEnv(config.scenario, 1, seed=4, num_threads=1)) as env:
        obs = np.repeat(env.reset(), 20_000, axis=0)
    drawn, expected = team.act(PolicyInput(obs)), learner.act(torch.tensor(obs)).numpy()
    np.testing.assert_allclose(drawn.mean(axis=0), expected.mean(axis=0), atol=0.02)
    np.testing.assert_allclose(drawn.std(axis=0), expected.std(axis=0), atol=0.02)
    team.reset(3)
    np.testing.assert_array_equal(team.act(PolicyInput(obs)), drawn)
    forces = np.array([team.decide("food_0", obs[0, 0]).force for _ in range(200)])
    assert np.linalg.norm(forces, axis=1).max() <= 1.0 + 1e-6
    assert len(np.unique(forces)) == 400


def test_the_contract_says_what_was_trained(framed: Made) -> None:
    run, folder = framed
    contract = Exported(folder, backend="numpy").contract
    config, _ = load_policy(run)
    with closing(BatchEnv(config.scenario, 1)) as env:
        assert [column.name for column in contract.observation] == env.observation_names()
    assert set(contract.actors) == {"food", "navigation", "medical"}
    assert [robot.actor for robot in contract.robots] == ["food", "food", "navigation", "medical"]
    assert contract.network.frame is not None
    assert contract.run["weights_sha256"] == RunFiles(run).info.weights_sha256
    assert contract.run["method"] == "ppo-inner"
    assert contract.checked is not None
    assert contract.checked.observations >= 10_000
    assert contract.checked.same_greedy_action == contract.checked.observations
    assert contract.checked.largest_difference_onnx < 1e-5
    units = {column.name: (column.unit, column.frame) for column in contract.observation}
    assert units["own.velocity.x"] == ("m/s", "world")
    assert units["victim_0.relative_position.y"] == ("m", "world axes, relative to the robot")
    assert units["teammate_2.ability.food"] == ("1", "none")


def test_files_are_those_of_the_contract_and_tell_nothing_of_the_machine(framed: Made) -> None:
    _, folder = framed
    document = json.loads((folder / "contract.json").read_text())
    found = {path.name for path in folder.iterdir()}
    assert found == {*document["files"], "contract.json"}
    for name, entry in document["files"].items():
        data = (folder / name).read_bytes()
        assert sha256(data).hexdigest() == entry["sha256"]
        assert str(Path.home()).encode() not in data
        assert b".py" not in data
    for name in document["actors"].values():
        onnx.checker.check_model(onnx.load(folder / name), full_check=True)


def test_what_differs_is_refused(framed: Made) -> None:
    """The check compares with the learner, not with the export itself."""
    run, folder = framed
    config, learner = load_policy(run)
    actor = inner_actor(learner, run)
    teams = [Exported(folder, backend=one) for one in ("onnxruntime", "numpy")]
    with torch.no_grad():
        dict(actor.named_parameters())["output.parametrizations.bias.original"][1, 2] += 0.001
    with pytest.raises(ExportError, match=r"navigation_0: the exported policy \(onnxruntime\) dif"):
        check_export(config, learner, actor, *teams)


@pytest.mark.long
@pytest.mark.parametrize(
    ("call", "number"),
    [
        ("rename", errno.EPERM),  # the last of all: only this one exports before
        *(
            (call, number)
            for call in ("replace", "fsync", "mkdir")
            for number in (errno.EPERM, errno.ENOTSUP, errno.ENOSPC)
        ),
    ],
)
def test_what_a_file_system_refuses_leaves_nothing(
    call: str, number: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = make_run(tmp_path / "run", run_config("td-inner"))

    def refuse(*_: object, **__: object) -> None:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(os, call, refuse)
    before = sorted(run.rglob("*"))
    with pytest.raises(ExportError) as caught:
        export_run(run)
    assert str(caught.value) == f"{run}/export: cannot be made ({os.strerror(number)})"
    assert sorted(run.rglob("*")) == before


def test_a_folder_that_is_there_is_left_alone(tmp_path: Path) -> None:
    run = make_run(tmp_path / "run", run_config("td-inner"))
    for name in ("folder", "file"):
        target = tmp_path / name
        target.mkdir() if name == "folder" else target.write_text("mine")
        with pytest.raises(ExportError, match=f"{name}: is already there"):
            export_run(run, target)
    with pytest.raises(ExportError, match="no such folder"):
        export_run(run, tmp_path / "none" / "export")
    assert (tmp_path / "file").read_text() == "mine"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file", "folder", "run"]


def test_what_fails_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    run = make_run(tmp_path / "run", run_config("td-inner"))

    def fail(*_: object) -> None:
        raise ExportError("differs")

    monkeypatch.setattr("innerattn.train.export.write.onnx_files", fail)
    with pytest.raises(ExportError, match="differs"):
        export_run(run, tmp_path / "export")
    assert [path.name for path in tmp_path.iterdir()] == ["run"]


def test_policies_of_other_kinds_are_refused(tmp_path: Path) -> None:
    _, learner = load_policy(make_run(tmp_path / "run", run_config("td-inner")))
    learner.actor = torch.nn.Linear(1, 1)  # type: ignore[attr-defined]
    with pytest.raises(ExportError, match="its policy is a Linear: must be an innerattn"):
        inner_actor(learner, tmp_path / "run")


def test_a_run_without_weights_is_refused(tmp_path: Path) -> None:
    from innerattn.train import RunFolder

    RunFolder.create(tmp_path / "run", run_config("td-inner"), threads=1)
    with pytest.raises(RunError, match="holds no checkpoint yet"):
        export_run(tmp_path / "run", tmp_path / "export")
    assert not (tmp_path / "export").exists()


def wheels(rays: bool) -> dict[str, object]:
    """Keys of a team on wheels beside a robot that sets its velocity, with short sight and rays."""
    sensor = RangeSensor(rays=6, range_m=0.8, field_of_view_deg=180.0) if rays else None
    food, other, navigation, medical = Scenario().robots
    robots = (
        food.replace(drive="differential", range_sensor=sensor, sight_m=0.9),
        other.replace(drive="unicycle", range_sensor=sensor),
        navigation.replace(drive="unicycle"),
        medical.replace(drive="velocity", layer="air"),
    )
    return {"scenario.robots": [one.model_dump() for one in robots], "scenario.situation": "double"}


def stores() -> dict[str, object]:
    """Keys of a team with a battery, a load and rays all around."""
    sensor = RangeSensor(rays=8, range_m=1.0)
    food, other, *others = (robot.replace(range_sensor=sensor) for robot in Scenario().robots)
    robots = (food.replace(load=2), other.replace(battery=Battery(capacity_j=9.0, idle_w=1.0)))
    return {
        "scenario.robots": [one.model_dump() for one in (*robots, *others)],
        "scenario.depots": [{"position_m": [0.5, 0.0]}],
        "scenario.communication": {"range_m": 0.8},
    }


@pytest.mark.long
@pytest.mark.parametrize("actions", ["discrete", "continuous"])
@pytest.mark.parametrize(
    "values",
    [FRAMED | wheels(True), wheels(False), FRAMED | stores() | {"network.symmetry": "none"}],
    ids=["wheels and rays in frames", "wheels", "stores"],  # depots have a place: no frames
)
def test_teams_of_every_drive_and_sense_play_as_the_trained_ones(
    tmp_path: Path, values: dict[str, object], actions: str
) -> None:
    values = values | {"scenario.actions": actions}
    run, folder = made_export(tmp_path, "ppo-inner", **values)
    config, learner = load_policy(run)
    exported = [Exported(folder, backend=one, greedy=True) for one in ("numpy", "onnxruntime")]
    assert exported[0].contract.checked is not None
    with closing(BatchEnv(config.scenario, 32, seed=9, num_threads=1)) as env:
        obs = env.reset()
        taken = []
        for _ in range(20):
            commands = learner.act(torch.tensor(obs), greedy=True).numpy()
            for one in exported:
                np.testing.assert_allclose(one.act(PolicyInput(obs)), commands, atol=1e-5)
            taken.append(commands)
            obs = env.step(commands).obs
    assert len(np.unique(np.round(taken, 2))) > 2


def test_a_team_with_messages_is_trained_and_not_exported(tmp_path: Path) -> None:
    run = make_run(tmp_path / "run", run_config("ppo-inner", **{"network.message_width": 8}))
    with pytest.raises(ExportError, match=r"network.message_width = 8: must be 0; exported polic"):
        export_run(run, tmp_path / "export")
    assert not (tmp_path / "export").exists()


def test_a_team_that_remembers_is_trained_and_not_exported(tmp_path: Path) -> None:
    run = make_run(tmp_path / "run", run_config("ppo-inner", **{"network.memory_width": 8}))
    with pytest.raises(ExportError, match=r"network.memory_width = 8: exported policies have no m"):
        export_run(run, tmp_path / "export")
    assert not (tmp_path / "export").exists()
