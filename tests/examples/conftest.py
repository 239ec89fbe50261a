"""Packages in examples/, as if they were installed."""

import importlib
import os
import subprocess
import sys
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType

import pytest

from innerattn.config import registry

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.fixture
def imported(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[str], ModuleType]]:
    """Imports an example; what it registers lasts as long as the test."""
    before = set(sys.modules)
    for name in ("_algorithms", "_attentions"):
        monkeypatch.setattr(registry, name, dict(getattr(registry, name)))

    def load(name: str) -> ModuleType:
        monkeypatch.syspath_prepend(EXAMPLES / name)
        return importlib.import_module(name)

    yield load
    for name in set(sys.modules) - before:
        if name.split(".")[0] in {folder.name for folder in EXAMPLES.iterdir()}:
            del sys.modules[name]


@pytest.fixture
def run_installed(tmp_path: Path) -> Callable[..., subprocess.CompletedProcess[str]]:
    """Runs the command `innerattn` where an example is installed with its entry points."""

    def run(name: str, *arguments: str) -> subprocess.CompletedProcess[str]:
        project = tomllib.loads((EXAMPLES / name / "pyproject.toml").read_text("utf-8"))["project"]
        info = tmp_path / "site" / f"{project['name'].replace('-', '_')}-1.0.dist-info"
        info.mkdir(parents=True)
        (info / "METADATA").write_text(
            f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: {project['version']}\n"
        )
        points = [
            f"[{group}]\n" + "".join(f"{key} = {value}\n" for key, value in entries.items())
            for group, entries in project["entry-points"].items()
        ]
        (info / "entry_points.txt").write_text("\n".join(points))
        path = os.pathsep.join([str(info.parent), str(EXAMPLES / name), *sys.path])
        return subprocess.run(
            [sys.executable, "-m", "innerattn", *arguments],
            env=os.environ | {"PYTHONPATH": path},
            cwd=tmp_path,
            capture_output=True,
            text=True,
            check=True,
        )

    return run
