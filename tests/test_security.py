"""The source runs no code that a file holds, and every line of the threat model has its test."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
SOURCES = sorted(
    path
    for folder in ("python", "examples", "packages")
    for path in (ROOT / folder).rglob("*.py")
    if not any(part.startswith(".") for part in path.relative_to(ROOT).parts)  # environments
)

UNPICKLING = {"pickle", "_pickle", "cPickle", "dill", "cloudpickle", "joblib", "marshal", "shelve"}
MODULES = UNPICKLING | {"yaml", "code", "codeop", "runpy"}
CALLS = {
    *("eval", "exec", "compile", "__import__", "execfile"),
    *("torch.load", "torch.jit.load", "torch.hub.load", "torch.package", "numpy.memmap"),
    *("numpy.load", "numpy.fromfile", "pandas.read_pickle", "importlib.import_module"),
    *("os.system", "os.popen", "runpy.run_path"),
    *("yaml.load", "yaml.load_all", "yaml.full_load", "yaml.full_load_all"),
    *("yaml.unsafe_load", "yaml.unsafe_load_all"),
}
ALLOWED = {
    # Names of installed packages' entry points, never of a file.
    "python/innerattn/config/registry.py": {"importlib.import_module"},
    # It calls `yaml.safe_load` alone: others stay forbidden.
    "python/innerattn/config/map_file.py": {"yaml"},
    # Modules of this package and libraries, named in the source.
    "python/innerattn/lazy.py": {"importlib.import_module"},
    "python/innerattn/shown.py": {"importlib.import_module"},
    "python/innerattn/loggers/logger.py": {"importlib.import_module"},
}


def names(tree: ast.AST) -> dict[str, str]:
    """What each imported name stands for."""
    found = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for one in node.names:
                found[one.asname or one.name.partition(".")[0]] = (
                    one.name if one.asname else one.name.partition(".")[0]
                )
        elif isinstance(node, ast.ImportFrom) and node.module:
            for one in node.names:
                found[one.asname or one.name] = f"{node.module}.{one.name}"
    return found


def forbidden(text: str) -> Iterator[str]:
    """Modules and calls in a source that could run what a file holds."""
    tree = ast.parse(text)
    known = names(tree)
    for meaning in known.values():
        if meaning.partition(".")[0] in MODULES:
            yield meaning
    for node in ast.walk(tree):
        if not isinstance(node, ast.Call):
            continue
        called = ast.unparse(node.func)
        first, dot, rest = called.partition(".")
        called = known.get(first, first) + dot + rest
        if called in CALLS:
            yield called
        for keyword in node.keywords:
            if keyword.arg in ("allow_pickle", "shell") and ast.unparse(keyword.value) != "False":
                yield f"{called}({keyword.arg}=...)"


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_nothing_is_unpickled_or_evaluated(path: Path) -> None:
    allowed = ALLOWED.get(path.relative_to(ROOT).as_posix(), set())
    assert set(forbidden(path.read_text("utf-8"))) - allowed == set()


@pytest.mark.parametrize(
    ("source", "found"),
    [
        ("import pickle", "pickle"),
        ("from pickle import loads as read", "pickle.loads"),
        ("import torch\ntorch.load('x')", "torch.load"),
        ("import torch as t\nt.load('x', weights_only=True)", "torch.load"),
        ("from torch import load\nload('x')", "torch.load"),
        ("import numpy as np\nnp.load('x')", "numpy.load"),
        ("open_it('x', allow_pickle=True)", "open_it(allow_pickle=...)"),
        ("eval('1')", "eval"),
        ("exec('1')", "exec"),
        ("__import__('x')", "__import__"),
        ("import subprocess\nsubprocess.run('x', shell=True)", "subprocess.run(shell=...)"),
    ],
)
def test_the_scan_finds_what_it_looks_for(source: str, found: str) -> None:
    assert list(forbidden(source)) == [found]


def test_who_may_import_yaml_may_call_safe_load_alone() -> None:
    assert set(forbidden("import yaml\nyaml.safe_load('x')")) == {"yaml"}
    assert set(forbidden("import yaml as y\ny.unsafe_load('x')")) == {"yaml", "yaml.unsafe_load"}


def test_the_scan_leaves_the_rest_alone() -> None:
    text = "import re, torch\nre.compile('x')\ntorch.compile(f)\nmodel.eval()\nlearner.load(x)\n"
    assert list(forbidden(text)) == []


def test_every_line_of_the_threat_model_names_a_test_that_is_there() -> None:
    page = (ROOT / "SECURITY.md").read_text("utf-8")
    rows = [line for line in page.splitlines() if line.startswith("| ") and "attack |" not in line]
    assert len(rows) >= 25
    for row in rows:
        named = re.findall(r"`(tests/\S+\.py)::(test_\w+)` \|$", row)
        assert len(named) == 1, row
        ((file, test),) = named
        assert f"def {test}(" in (ROOT / file).read_text("utf-8"), row
