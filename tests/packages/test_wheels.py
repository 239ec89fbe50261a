"""Script, workflow, Makefile and page name the same wheels; a trial notices differences."""

import importlib.util
import json
import re
import struct
import sys
import zipfile
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
import yaml

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "packages" / "wheels"


def module(name: str, monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """A script of the folder, with the names beside it."""
    monkeypatch.syspath_prepend(str(FOLDER))
    spec = importlib.util.spec_from_file_location(f"wheels_{name}", FOLDER / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    found = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(found)
    return found


@pytest.fixture
def build(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    return module("build", monkeypatch)


@pytest.fixture
def compare(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    return module("compare", monkeypatch)


@pytest.fixture(scope="module")
def workflow() -> dict[str, Any]:
    text = (ROOT / ".github" / "workflows" / "release.yml").read_text("utf-8")
    found: dict[str, Any] = yaml.safe_load(text)
    return found


def rows() -> dict[str, list[str]]:
    """The cells of the page's table, by the name of the wheel."""
    text = (ROOT / "docs" / "wheels.md").read_text("utf-8")
    lines = re.findall(r"(?m)^\| `([\w-]+)` \|(.*)\|$", text)
    return {name: [cell.strip() for cell in cells.split("|")] for name, cells in lines}


def test_the_workflow_builds_the_wheels_of_the_script(
    build: ModuleType, workflow: dict[str, Any]
) -> None:
    built = workflow["jobs"]["build"]["strategy"]["matrix"]["include"]
    expected = [(name, wheel.target) for name, wheel in build.WHEELS.items()]
    assert [(one["wheel"], one["target"]) for one in built] == expected
    tried = {one["wheel"] for one in workflow["jobs"]["try"]["strategy"]["matrix"]["include"]}
    assert tried < set(build.WHEELS)


def test_the_page_has_a_row_for_each_wheel_of_the_script(build: ModuleType) -> None:
    assert {name: cells[0] for name, cells in rows().items()} == {
        name: f"`{wheel.tag}`" for name, wheel in build.WHEELS.items()
    }
    for name, (_, built, run, compared) in rows().items():
        assert built.split(",")[0].split(":")[0] in ("yes", "no"), name
        assert run.split(",")[0].split(":")[0] in ("yes", "no"), name
        assert (compared == "nothing") == run.startswith("no"), name


def test_the_page_and_the_workflow_name_targets_that_the_makefile_has(
    workflow: dict[str, Any],
) -> None:
    makefile = (ROOT / "Makefile").read_text("utf-8")
    targets = set(re.findall(r"(?m)^([\w-]+):", makefile))
    page = (ROOT / "docs" / "wheels.md").read_text("utf-8")
    commands = [step.get("run", "") for job in workflow["jobs"].values() for step in job["steps"]]
    named = set(re.findall(r"\bmake ([a-z][\w-]*)", "\n".join([page, *commands])))
    assert {"wheels", "wheels-check"} <= named <= targets
    assert {"wheels", "wheels-check"} <= set(re.findall(r"\.PHONY:(.*)", makefile)[0].split())
    for script in re.findall(r"packages/wheels/(\w+\.py)", "\n".join([makefile, page, *commands])):
        assert (FOLDER / script).is_file(), script


def a_wheel(folder: Path, tag: str, content: bytes, name: str = "_core.abi3.so") -> Path:
    file = folder / f"innerattn-0.2.0-cp311-abi3-{tag}.whl"
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr(f"innerattn/{name}", content)
    return file


def test_a_wheel_is_refused_whose_name_or_module_is_of_another_system(
    build: ModuleType, tmp_path: Path
) -> None:
    tag = "manylinux2014_aarch64.manylinux_2_17_aarch64"
    arm = struct.pack("<4sBBB9xHH", b"\x7fELF", 2, 1, 1, 3, 183) + bytes(20)
    build.check(a_wheel(tmp_path, tag, arm), build.WHEELS["linux-aarch64"])
    with pytest.raises(build.BuildError, match=r"must end with manylinux_2_17_x86_64\.whl"):
        build.check(a_wheel(tmp_path, tag, arm), build.WHEELS["linux-x86_64"])
    other = struct.pack("<4sBBB9xHH", b"\x7fELF", 2, 1, 1, 3, 62) + bytes(20)
    with pytest.raises(build.BuildError, match="is not for aarch64-unknown-linux-gnu"):
        build.check(a_wheel(tmp_path, tag, other), build.WHEELS["linux-aarch64"])
    with pytest.raises(build.BuildError, match=r"has no innerattn/_core\.pyd"):
        build.check(a_wheel(tmp_path, "win_amd64", b"MZ"), build.WHEELS["windows-x86_64"])


def test_zig_is_told_the_name_that_the_windows_module_exports(
    build: ModuleType, tmp_path: Path
) -> None:
    (tmp_path / "maturin").mkdir()
    (tmp_path / "maturin" / "innerattn._core.def").write_text("of an earlier maturin")
    for _ in range(2):
        env = build.for_windows("x86_64-pc-windows-gnu", tmp_path)
        flag = env["CARGO_ENCODED_RUSTFLAGS"].split("\x1f")
        assert flag[0] == "-C"
        exports = Path(flag[1].removeprefix("link-arg=")).read_text("utf-8").split()
        assert exports == ["LIBRARY", "_core", "EXPORTS", "PyInit__core"]
        assert env["CFLAGS_x86_64_pc_windows_gnu"] == "-Wno-error=date-time"
    assert (tmp_path / "maturin" / "innerattn._core.def").is_dir()  # maturin cannot write it


def test_messages_say_what_is_needed(
    build: ModuleType,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert "RUST_SRC=FOLDER" in build.sources_wanted(tmp_path)
    (tmp_path / "std").mkdir()
    (tmp_path / "std" / "Cargo.toml").write_text("")
    assert build.sources_wanted(tmp_path) is None
    monkeypatch.setattr(sys, "argv", ["build.py", "linux-arm"])
    with pytest.raises(SystemExit):
        build.main()
    said = capsys.readouterr().err
    assert "linux-arm: no such wheel; there are linux-x86_64, " in said
    monkeypatch.setattr(build.shutil, "which", lambda _: None)
    monkeypatch.setattr(build.importlib.util, "find_spec", lambda _: None)
    monkeypatch.setattr(sys, "argv", ["build.py"])
    assert build.main() == 1
    said = capsys.readouterr().err
    assert "cargo: install Rust" in said
    assert "pip install ziglang" in said


def test_whatever_a_trial_finds_otherwise_is_a_difference(compare: ModuleType) -> None:
    logits = np.random.default_rng(3).normal(0.0, 10.0, 40).astype("<f4")
    known = {
        "kept": compare.kept(),
        "presets": {"mixed": "a", "single": "b"},
        "team": {
            "actions": [0, 3, 4],
            "observations": "c",
            "logits": logits.tobytes().hex(),
            "call_us": 30.0,
        },
    }
    assert compare.differences(known, known) == []
    slower = json.loads(json.dumps(known))
    slower["team"]["call_us"] = 500.0
    near = logits * np.float32(1 + 2e-7)
    slower["team"]["logits"] = near.astype("<f4").tobytes().hex()
    assert compare.differences(slower, known) == []
    for part, key, value in (
        ("kept", "tight", "other"),
        ("presets", "single", "other"),
        ("team", "actions", [0, 3, 3]),
        ("team", "observations", "other"),
        ("team", "logits", (logits + np.float32(0.01)).tobytes().hex()),
        ("team", "logits", logits[:-1].tobytes().hex()),
        ("team", "logits", np.full(40, np.nan, "<f4").tobytes().hex()),
    ):
        other = json.loads(json.dumps(known))
        other[part][key] = value
        assert len(compare.differences(other, known)) == 1, (part, key)
    missing = json.loads(json.dumps(known))
    del missing["kept"]["tight"]
    assert len(compare.differences(missing, known)) == 1
