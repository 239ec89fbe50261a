"""The sorts of problems that an example makes worlds of."""

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from innerattn.cli.main import main
from innerattn.config.instances import read_worlds

PATH = Path(__file__).parents[2] / "examples" / "instances" / "sorts.py"


@pytest.fixture
def sorts() -> ModuleType:
    spec = importlib.util.spec_from_file_location("sorts", PATH)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("sort", ["fire", "flood"])
def test_a_sort_is_written_and_measured(
    sort: str,
    sorts: ModuleType,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    path = tmp_path / "worlds.json"
    monkeypatch.setattr(sys, "argv", ["sorts.py", sort, "-o", str(path), "--count", "2"])
    sorts.main()
    assert capsys.readouterr().out == f"{path}: 2 worlds\n"
    worlds = read_worlds(path)
    assert [one.name for one in worlds] == [f"{sort}_0", f"{sort}_1"]
    assert worlds[0].scenario == sorts.SORTS[sort](np.random.default_rng([0, 0]))
    assert worlds[0].reference.rescued >= 0.8 * worlds[0].victims
    assert main(["evaluate", "planner", "--instances", str(path), "--quiet"]) == 0
    assert ", 2 worlds\n" in capsys.readouterr().out
