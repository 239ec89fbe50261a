"""The wheel for robots: built from the package's sources, it acts as the package does."""

import ast
import importlib.util
import json
import os
import subprocess
import sys
import tomllib
import zipfile
from email import message_from_string
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from once import made_once

from innerattn.config import Scenario
from innerattn.envs import BatchEnv
from innerattn.policies import Exported
from innerattn.policies.exported.contract import contract_text
from innerattn.zoo import run_path

ROOT = Path(__file__).parents[2]
SCRIPT = ROOT / "packages" / "policies" / "build_wheel.py"
COUNT = 1_000

ACT = """
import importlib.util, json, sys
if len(sys.argv) > 3:
    sys.path[:0] = sys.argv[3:]
assert importlib.util.find_spec("innerattn") is None
import numpy as np
from innerattn_policies import Exported

team = Exported(sys.argv[1], backend="numpy", greedy=True)
obs = np.load(sys.argv[2])
found = {"forces": [], "logits": []}
for index, robot in enumerate(team.robot_names):
    decisions = [team.decide(robot, row) for row in obs[:, index]]
    found["forces"].append([one.force.tolist() for one in decisions])
    found["logits"].append(team.logits(robot, np.ascontiguousarray(obs[:, index])).tolist())
class View: pass
view = View()
view.obs = obs
found["actions"] = team.act(view).tolist()
print(json.dumps(found))
"""


def build() -> Any:
    """The program that builds the wheel, as a module."""
    spec = importlib.util.spec_from_file_location("build_wheel", SCRIPT)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("wheel")
    done = subprocess.run(
        [sys.executable, str(SCRIPT), str(folder)], capture_output=True, text=True, check=True
    )
    (found,) = folder.glob("*.whl")
    assert done.stdout.startswith(f"{found}: ")
    return found


@pytest.fixture(scope="module")
def installed(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel as pip installs it, in a folder of its own."""
    target = tmp_path_factory.mktemp("installed")
    command = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-index"]
    subprocess.run([*command, "--target", str(target), str(wheel)], check=True)
    return target


@pytest.fixture(scope="module")
def zoo_team(tmp_path_factory: pytest.TempPathFactory) -> Path:
    from innerattn.train.export import export_run  # PyTorch takes long to load what exports

    def make(folder: Path) -> None:
        export_run(run_path("zoo:mixed"), folder / "export")

    return made_once(tmp_path_factory, "zoo_team", make)


def random_observations(folder: Path) -> np.ndarray:
    """(1,000, R, D): half of played worlds, half of any numbers."""
    team = Exported(folder, backend="numpy")
    rng = np.random.default_rng(8)
    scenario = Scenario.model_validate(team.contract.scenario)
    with BatchEnv(scenario, COUNT // 2, seed=2) as env:
        obs = env.reset()
        for _ in range(7):
            actions = rng.integers(0, 5, obs.shape[:2])
            obs = env.step(actions).obs
    return np.concatenate([obs, rng.normal(size=obs.shape).astype(np.float32)])


def acted(export: Path, obs: np.ndarray, tmp_path: Path, *command: str) -> dict[str, Any]:
    """What the wheel's team does in another process."""
    np.save(tmp_path / "obs.npy", obs)
    first, *paths = command
    words = [first, "-I", "-S", "-c", ACT, str(export), str(tmp_path / "obs.npy"), *paths]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def numpy_alone(folder: Path) -> Path:
    """A folder from which nothing but numpy can be imported."""
    folder.mkdir()
    home = Path(np.__file__).parent
    for one in (home, home.with_name("numpy.libs")):
        if one.exists():
            (folder / one.name).symlink_to(one)
    return folder


@pytest.mark.parametrize("name", ["zoo_team", "framed_team", "any_team"])
def test_a_team_acts_as_with_the_whole_package(
    request: pytest.FixtureRequest, installed: Path, tmp_path: Path, name: str
) -> None:
    export = request.getfixturevalue(name) / "export"
    obs = random_observations(export)
    paths = (str(installed), str(numpy_alone(tmp_path / "numpy")))
    found = acted(export, obs, tmp_path, sys.executable, *paths)
    team = Exported(export, backend="numpy", greedy=True)
    for index, robot in enumerate(team.robot_names):
        logits = team.logits(robot, np.ascontiguousarray(obs[:, index]))
        np.testing.assert_array_equal(np.array(found["logits"][index], np.float32), logits)
        forces = [team.decide(robot, row).force for row in obs[:, index]]
        np.testing.assert_array_equal(np.array(found["forces"][index], np.float32), forces)
        np.testing.assert_array_equal(np.array(found["actions"])[:, index], logits.argmax(axis=1))


OLD = os.environ.get("INNERATTN_OLD_PYTHON")


@pytest.mark.skipif(OLD is None, reason="INNERATTN_OLD_PYTHON names no Python 3.9 with numpy")
@pytest.mark.parametrize("name", ["zoo_team", "any_team"])
def test_a_team_acts_the_same_in_an_old_python(
    request: pytest.FixtureRequest, installed: Path, tmp_path: Path, name: str
) -> None:
    assert OLD is not None
    export = request.getfixturevalue(name) / "export"
    code = "import numpy, os, sys; print(os.path.dirname(os.path.dirname(numpy.__file__)))"
    asked = subprocess.run([OLD, "-I", "-c", code], capture_output=True, text=True, check=True)
    obs = random_observations(export)
    found = acted(export, obs, tmp_path, OLD, str(installed), asked.stdout.strip())
    team = Exported(export, backend="numpy", greedy=True)
    for index, robot in enumerate(team.robot_names):
        logits = team.logits(robot, np.ascontiguousarray(obs[:, index]))
        np.testing.assert_allclose(found["logits"][index], logits, rtol=1e-4, atol=1e-4)
        np.testing.assert_array_equal(np.array(found["actions"])[:, index], logits.argmax(axis=1))


def test_a_damaged_contract_is_refused_alike(
    installed: Path, plain_team: Path, tmp_path: Path
) -> None:
    document = json.loads((plain_team / "export" / "contract.json").read_text())
    del document["sha256"]
    document["robots"][1]["mass_kg"] = -1.0
    code = """
import json, sys
sys.path[:0] = sys.argv[1:]
from innerattn_policies.contract import contract_text
try:
    contract_text(json.load(sys.stdin))
except ValueError as error:
    print(error)
"""
    paths = [str(installed), str(numpy_alone(tmp_path / "numpy"))]
    done = subprocess.run(
        [sys.executable, "-I", "-S", "-c", code, *paths],
        input=json.dumps(document),
        capture_output=True,
        text=True,
        check=True,
    )
    with pytest.raises(ValueError, match=r"^robots\.1\.mass_kg: is -1\.0: must be a fini") as ours:
        contract_text(document)
    assert done.stdout == f"{ours.value}\n"


def test_both_packages_can_be_installed_together(installed: Path) -> None:
    tops = {path.name for path in installed.iterdir()}
    assert {one for one in tops if not one.endswith(".dist-info")} == {"innerattn_policies"}
    code = """
import sys
sys.path[:0] = sys.argv[1:]
import innerattn.policies, innerattn_policies
print(innerattn.policies.Exported is innerattn_policies.Exported)
print(sorted(innerattn_policies.__all__) == sorted(innerattn.policies.exported.__all__))
"""
    paths = [str(ROOT / "python"), str(installed)]
    command = [sys.executable, "-c", code, *paths]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False", "True"]


def test_the_wheel_is_small_and_its_record_and_metadata_are_true(wheel: Path) -> None:
    assert wheel.stat().st_size < 100_000
    cargo = tomllib.loads((ROOT / "Cargo.toml").read_text("utf-8"))
    version = cargo["workspace"]["package"]["version"]
    assert wheel.name == f"innerattn_policies-{version}-py3-none-any.whl"
    with zipfile.ZipFile(wheel) as archive:
        assert archive.testzip() is None
        files = {name: archive.read(name) for name in archive.namelist()}
    about = f"innerattn_policies-{version}.dist-info"
    rows = [line.split(",") for line in files[f"{about}/RECORD"].decode().splitlines()]
    assert [path for path, _, _ in rows] == list(files)
    for path, _, size in rows[:-1]:
        assert int(size) == len(files[path])
    said = message_from_string(files[f"{about}/METADATA"].decode())
    assert (said["Name"], said["Version"]) == ("innerattn-policies", version)
    assert said["Requires-Python"] == ">=3.9"
    assert said.get_all("Requires-Dist")[0] == "numpy>=1.21"


def test_the_same_sources_give_the_same_wheel(wheel: Path) -> None:
    module = build()
    assert module.wheel() == (wheel.name, wheel.read_bytes())


def test_modules_that_are_not_in_the_wheel_are_refused() -> None:
    module = build()
    text = (
        "from innerattn.errors import ReadingError\n    import innerattn.policies.exported.team\n"
    )
    assert module.renamed(text, "a.py") == (
        "from innerattn_policies.errors import ReadingError\n    import innerattn_policies.team\n"
    )
    with pytest.raises(ValueError, match=r"^a\.py: imports innerattn\.envs, which is not in the "):
        module.renamed("x = 1\nfrom innerattn.envs import BatchEnv\n", "a.py")


ALLOWED = {"__future__", "innerattn_policies", "numpy", "onnxruntime"}
"""What its modules may import beside the standard library."""
LATER = {"tomllib"}
"""Modules of the standard library that Python 3.9 lacks."""


def too_new(text: str) -> list[str]:
    """What a module has that Python 3.9 or its libraries lack."""
    tree = ast.parse(text, feature_version=(3, 9))
    found = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Call):
            called = ast.unparse(node.func)
            given = {word.arg for word in node.keywords}
            if called == "zip" and "strict" in given:
                found.append("zip(strict=)")
            if called.rpartition(".")[2] == "dataclass" and given & {"slots", "kw_only"}:
                found.append("dataclass(slots=)")
            if called in ("isinstance", "issubclass") and isinstance(node.args[1], ast.BinOp):
                found.append(f"{called}(A | B)")
            if called.endswith((".bit_count", ".pairwise", ".add_note")):
                found.append(called)
        names = [one.name for one in node.names] if isinstance(node, ast.Import) else []
        if isinstance(node, ast.ImportFrom):
            names = [node.module or ""]
        for name in names:
            top = name.partition(".")[0]
            if top in LATER or not (top in ALLOWED or top in sys.stdlib_module_names):
                found.append(f"import {name}")
        if isinstance(node, ast.Match | ast.TryStar):
            found.append(type(node).__name__)
    if "from __future__ import annotations" not in text:
        found.append("no `from __future__ import annotations`")
    return found


def test_its_modules_are_those_of_python_3_9() -> None:
    modules = {path: text for path, text in build().sources().items() if path.endswith(".py")}
    assert len(modules) > 12
    for path, text in modules.items():
        assert too_new(text) == [], path


@pytest.mark.parametrize(
    "text",
    [
        "zip(a, b, strict=True)",
        "isinstance(a, int | str)",
        "from dataclasses import dataclass\n@dataclass(slots=True)\nclass A: pass",
        "import tomllib",
        "from pydantic import Field",
        "(3).bit_count()",
        "x: int | str = 1",
    ],
)
def test_the_scan_finds_what_is_too_new(text: str) -> None:
    head = "" if text.startswith("x:") else "from __future__ import annotations\n"
    assert len(too_new(head + text)) == 1


def test_the_scan_refuses_newer_grammar() -> None:
    with pytest.raises(SyntaxError):
        too_new("match a:\n    case 1: pass")
