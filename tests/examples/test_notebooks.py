"""The notebooks run from their first cell to their last, with shorter trainings."""

import ast
import json
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

NOTEBOOKS = Path(__file__).parents[2] / "examples" / "notebooks"
SHORTER = {
    "quickstart": {"STEPS = 300_000": "STEPS = 2_000"},
    "own_scenario": {"STEPS = 300_000": "STEPS = 2_000"},
    "own_study": {"train.env_steps = [100_000]": "train.env_steps = [1_000]"},
}
SHOWN = {"quickstart": 3, "own_scenario": 2, "own_study": 0}
"""How many cells end with something that has a picture or a page."""


def codes(name: str) -> list[str]:
    """The code cells of a notebook."""
    document = json.loads((NOTEBOOKS / f"{name}.ipynb").read_text("utf-8"))
    cells = [cell for cell in document["cells"] if cell["cell_type"] == "code"]
    return ["".join(cell["source"]) for cell in cells]


def run_cell(code: str, names: dict[str, Any], folder: Path) -> Any:
    """Do what IPython does with a cell; gives the value of its last line."""
    if code.startswith("%pip install"):
        return None
    if code.startswith("%%writefile "):
        first, text = code.split("\n", 1)
        (folder / first.split()[1]).write_text(text + "\n")
        return None
    if code.startswith("!innerattn "):
        words = [word.format(**names) for word in shlex.split(code)[1:]]
        done = subprocess.run(
            [sys.executable, "-m", "innerattn", *words], cwd=folder, capture_output=True, text=True
        )
        assert done.returncode == 0, done.stderr
        return None
    tree = ast.parse(code)
    last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
    exec(compile(tree, "cell", "exec"), names)
    if last is None:
        return None
    return eval(compile(ast.Expression(last.value), "cell", "eval"), names)


@pytest.mark.long
@pytest.mark.parametrize("name", SHORTER)
def test_a_notebook_runs(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {}
    replaced, shown = set(), []
    for code in codes(name):
        for old, new in SHORTER[name].items():
            replaced |= {old} if old in code else set()
            code = code.replace(old, new)
        value = run_cell(code, names, tmp_path)
        if hasattr(value, "_repr_html_"):
            shown.append(value._repr_html_())
    assert replaced == set(SHORTER[name])
    assert len(shown) == SHOWN[name]
    assert all("<iframe" in html or "<img" in html for html in shown)


def test_every_notebook_is_run_and_says_how_to_install() -> None:
    found = {file.stem for file in NOTEBOOKS.glob("*.ipynb")}
    assert found == {*SHORTER, "watch_a_team"}  # tests/report/test_notebook.py runs that one
    for name in SHORTER:
        assert codes(name)[0] == "%pip install --quiet 'innerattn[train,report]'"
