"""Exported teams act as the contract says, in both backends; altered folders are refused."""

import hashlib
import json
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from innerattn.config import Scenario
from innerattn.envs import BatchEnv
from innerattn.errors import ExportError, MissingLibraryError, ReadingError
from innerattn.policies import Exported, PolicyInput
from innerattn.policies.exported.contract import Contract, contract_text

BOTH = pytest.mark.parametrize("name", ["plain_export", "framed_export"])
BODY = {"position": (0.1, 0.2), "velocity": (0.0, 0.0)}
READINGS = {"own": BODY, "teammates": {}, "victims": []}


def seen(team: Exported, count: int, seed: int) -> np.ndarray:
    env = BatchEnv(Scenario.model_validate(team.contract.scenario), count, seed=seed)
    return env.reset()


@BOTH
def test_numpy_and_onnxruntime_agree(request: pytest.FixtureRequest, name: str) -> None:
    folder = request.getfixturevalue(name)
    plain, fast = (Exported(folder, backend=one, greedy=True) for one in ("numpy", "onnxruntime"))
    obs = seen(plain, 200, 1)
    np.testing.assert_array_equal(plain.act(PolicyInput(obs)), fast.act(PolicyInput(obs)))
    for index, robot in enumerate(plain.robot_names):
        rows = np.ascontiguousarray(obs[:, index])
        found, other = plain.logits(robot, rows), fast.logits(robot, rows)
        assert found.shape == (200, 5)
        assert found.std(axis=0).min() > 1e-4
        np.testing.assert_allclose(found, other, atol=1e-5)
        decision = fast.decide(robot, rows[0])
        assert decision.action == other[0].argmax()
        assert decision.probabilities.sum() == pytest.approx(1.0)
        np.testing.assert_array_equal(decision.row, rows[0])
        np.testing.assert_array_equal(
            decision.force, [(0, 0), (1, 0), (-1, 0), (0, 1), (0, -1)][decision.action]
        )


def test_a_framed_team_does_in_turned_worlds_what_it_does_in_these(framed_export: Path) -> None:
    """Mirror x, then swap x and y: +x becomes -y in the turned world."""
    team = Exported(framed_export, backend="numpy", greedy=True)
    readings = {
        "own": {"position": (0.1, -0.3), "velocity": (0.2, 0.4)},
        "teammates": {"food_1": {"position": (-0.5, 0.3), "velocity": (0.0, -0.2)}},
        "victims": [{"task": "task_1", "position": (0.7, 0.2)}],
    }

    def turned(value: Any) -> Any:
        if isinstance(value, tuple):
            return value[1], -value[0]
        if isinstance(value, dict):
            return {key: turned(one) for key, one in value.items()}
        return [turned(one) for one in value] if isinstance(value, list) else value

    for robot in ("food_0", "medical_0"):
        before, after = team.decide(robot, readings), team.decide(robot, turned(readings))
        np.testing.assert_allclose(after.probabilities[[0, 4, 3, 1, 2]], before.probabilities, 1e-5)
        assert before.probabilities.max() > 0.201


def test_drawn_actions_follow_the_probabilities_and_the_seed(plain_export: Path) -> None:
    team = Exported(plain_export, backend="numpy", greedy=False, seed=4)
    row = team.row("food_0", READINGS)
    first = [team.decide("food_0", row).action for _ in range(4_000)]
    shares = np.bincount(first, minlength=5) / 4_000
    np.testing.assert_allclose(shares, team.decide("food_0", row).probabilities, atol=0.04)
    team.reset(4)
    assert [team.decide("food_0", row).action for _ in range(50)] == first[:50]


@settings(max_examples=8)
@given(seed=st.integers(0, 2**32))
def test_a_velocity_command_is_what_the_world_does(plain_export: Path, seed: int) -> None:
    team = Exported(plain_export, backend="numpy")
    scenario = Scenario.model_validate(team.contract.scenario | {"arena_half_width_m": 50.0})
    env = BatchEnv(scenario, 16, seed=seed, num_threads=1)
    env.reset()
    rng = np.random.default_rng(seed)
    apart = np.broadcast_to([(10.0 * robot, 0.0) for robot in range(4)], (16, 4, 2))
    env.set_motion(apart, rng.uniform(-1.0, 1.0, (16, 4, 2)))
    for _ in range(3):
        before = env.velocities()
        actions = rng.integers(0, 5, (16, 4))
        env.step(actions)
        for world in range(16):
            for index, robot in enumerate(team.robot_names):
                force = team.contract.actions[actions[world, index]].force
                found = team.velocity_command(robot, force, before[world, index])
                np.testing.assert_allclose(found, env.velocities()[world, index], atol=1e-6)


def test_wrong_worlds_and_options_are_refused(plain_export: Path) -> None:
    team = Exported(plain_export, backend="numpy")
    obs = seen(team, 2, 0)
    for wrong in (obs[:, :3], obs[0], np.where(obs == obs[0, 0, 0], np.nan, obs)):
        with pytest.raises(ReadingError, match="obs: h"):
            team.act(PolicyInput(wrong))
    with pytest.raises(ValueError, match="backend = 'torch': must be 'onnxruntime' or 'numpy'"):
        Exported(plain_export, backend="torch")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="max_age_s = 0"):
        Exported(plain_export, max_age_s=0)
    with pytest.raises(ReadingError, match="force: is"):
        team.velocity_command("food_0", (1.0,), (0.0, 0.0))


def altered(export: Path, folder: Path, change: Callable[[Path, dict[str, Any]], None]) -> Path:
    """A copy whose contract was changed and sealed again."""
    copy = Path(shutil.copytree(export, folder / "copy"))
    document = json.loads((copy / "contract.json").read_text())
    del document["sha256"]
    change(copy, document)
    (copy / "contract.json").write_bytes(contract_text(document))
    return copy


def take_file(other: Path, name: str) -> Callable[[Path, dict[str, Any]], None]:
    """Another team's file, whose digest somebody wrote into the contract."""

    def change(folder: Path, document: dict[str, Any]) -> None:
        data = next(other.glob(f"*{Path(name).suffix}")).read_bytes()
        (folder / name).write_bytes(data)
        document["files"][name] = {"sha256": hashlib.sha256(data).hexdigest(), "bytes": len(data)}

    return change


def test_files_of_another_team_are_refused(
    plain_export: Path, framed_export: Path, tmp_path: Path
) -> None:
    swapped = Path(shutil.copytree(plain_export, tmp_path / "swapped"))
    shutil.copy(plain_export / "food_1.onnx", swapped / "food_0.onnx")
    for backend in ("numpy", "onnxruntime"):
        with pytest.raises(ExportError, match=r"food_0\.onnx: is not the file that contract"):
            Exported(swapped, backend=backend)  # type: ignore[arg-type]
    forged = altered(plain_export, tmp_path, take_file(framed_export, "food_0.onnx"))
    with pytest.raises(ExportError, match=r"food_0\.onnx: is not of this team and robot"):
        Exported(forged, backend="onnxruntime")
    shutil.rmtree(forged)
    forged = altered(plain_export, tmp_path, take_file(framed_export, "weights.safetensors"))
    with pytest.raises(ExportError, match="is missing or unknown"):
        Exported(forged, backend="numpy")


def test_damaged_folders_are_refused_in_one_line(plain_export: Path, tmp_path: Path) -> None:
    def cut(name: str) -> Callable[[Path], None]:
        return lambda folder: (folder / name).write_bytes((folder / name).read_bytes()[:-9])

    def edit(folder: Path) -> None:
        path = folder / "contract.json"
        path.write_text(path.read_text().replace('"max_speed_mps": 1.0', '"max_speed_mps": 9.0'))

    def link(folder: Path) -> None:
        (folder / "food_0.onnx").unlink()
        (folder / "food_0.onnx").symlink_to(plain_export / "food_0.onnx")

    cases: list[tuple[Callable[[Path], None], str]] = [
        (lambda folder: shutil.rmtree(folder), "no such folder"),
        (lambda folder: (folder / "contract.json").unlink(), r"contract\.json: missing"),
        (lambda folder: (folder / "food_0.onnx").unlink(), r"food_0\.onnx: missing"),
        (lambda folder: (folder / "contract.json").write_text("{}"), "not the contract"),
        (link, r"food_0\.onnx: missing, or not a plain file"),
        (cut("food_0.onnx"), "was altered"),
        (cut("weights.safetensors"), "was altered"),
        (cut("contract.json"), r"contract\.json: "),
        (edit, "does not fit its own digest"),
    ]
    for number, (damage, message) in enumerate(cases):
        copy = Path(shutil.copytree(plain_export, tmp_path / str(number)))
        damage(copy)
        with pytest.raises(ExportError, match=message) as caught:
            Exported(copy, backend="numpy")
        assert "\n" not in str(caught.value)


def test_later_versions_and_values_that_cannot_be_are_refused(plain_export: Path) -> None:
    document = json.loads((plain_export / "contract.json").read_text())
    del document["sha256"]
    cases = [("version", 2), ("control_period_s", -1.0), ("damping", "much"), ("robots", [])]
    for key, value in cases:
        with pytest.raises(ValueError, match=key):
            contract_text({**document, key: value})
    with pytest.raises(ValueError, match="scenario_sha256"):
        contract_text({**document, "scenario": {**document["scenario"], "dt_s": 0.2}})


def test_numpy_alone_is_enough(plain_export: Path) -> None:
    """Neither torch, safetensors, onnxruntime nor the worlds are imported."""
    code = f"""
import sys
for name in ("torch", "safetensors", "onnxruntime", "onnx", "scipy"):
    sys.modules[name] = None
from innerattn.policies.exported import Exported
team = Exported({str(plain_export)!r}, backend="numpy")
print(team.backend, team.decide("food_0", {READINGS!r}).action in range(5))
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stdout == "numpy True\n", done.stderr


def test_without_onnxruntime_numpy_is_taken(
    plain_export: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert Exported(plain_export).backend == "onnxruntime"
    monkeypatch.setitem(sys.modules, "onnxruntime", None)
    monkeypatch.setattr("innerattn.policies.exported.backend.find_spec", lambda _: None)
    assert Exported(plain_export).backend == "numpy"
    with pytest.raises(MissingLibraryError, match=r"pip install onnxruntime$"):
        Exported(plain_export, backend="onnxruntime")


def test_the_example_on_the_page_about_deployment_works(plain_export: Path) -> None:
    page = Path(__file__).parents[3] / "docs" / "deployment.md"
    (example,) = re.findall(r"```python\n(.*?)```", page.read_text("utf-8"), flags=re.DOTALL)
    known: dict[str, Any] = {"folder": plain_export}
    exec(compile(example, str(page), "exec"), known)
    assert known["velocity"].shape == (2,)
    keys = set(re.findall(r"`(\w+)`", page.read_text("utf-8")))
    assert {field.name for field in fields(Contract)} - {"about"} <= keys


def damage_network(folder: Path, document: dict[str, Any]) -> None:
    """NaN in the last layer of an ONNX file, whose digest somebody wrote into the contract."""
    model = onnx.load(folder / "food_0.onnx")
    for tensor in model.graph.initializer:
        values = onnx.numpy_helper.to_array(tensor).copy()
        if values.dtype == np.float32:
            values.fill(np.nan)
            tensor.CopyFrom(onnx.numpy_helper.from_array(values, tensor.name))
    data = model.SerializeToString()
    (folder / "food_0.onnx").write_bytes(data)
    entry = {"sha256": hashlib.sha256(data).hexdigest(), "bytes": len(data)}
    document["files"]["food_0.onnx"] = entry


def test_networks_that_give_no_numbers_are_refused(plain_export: Path, tmp_path: Path) -> None:
    folder = altered(plain_export, tmp_path, damage_network)
    with pytest.raises(ExportError, match="food_0: gives numbers that are not finite"):
        Exported(folder, backend="onnxruntime")


@BOTH
@pytest.mark.parametrize("backend", ["numpy", "onnxruntime"])
@pytest.mark.parametrize("greedy", [True, False])
def test_what_is_not_finite_is_never_an_action(
    request: pytest.FixtureRequest, name: str, backend: Any, greedy: bool
) -> None:
    folder = request.getfixturevalue(name)
    team = Exported(folder, backend=backend, greedy=greedy)
    width = len(team.contract.observation)
    huge = np.full((1, len(team.robot_names), width), 3e38, np.float32)
    first: Any = Exported(folder, backend="numpy")._actors[0]
    signs = first._layers["first"][0] if name == "plain_export" else -np.ones((width, 1))
    weights = np.abs(signs).sum(axis=0).argmax()
    huge *= np.where(signs[:, weights] < 0.0, -1.0, 1.0).astype(np.float32)
    calls: list[Callable[[], object]] = [
        lambda: team.decide("food_0", huge[0, 0]),
        lambda: team.logits("food_0", huge[0, :1]),
        lambda: team.act(PolicyInput(huge)),
    ]
    for call in calls:
        with pytest.raises(ReadingError, match="row: is beyond what the policy of food_0 can act"):
            call()
    assert team.decide("food_0", np.zeros(width)).action in range(5)
