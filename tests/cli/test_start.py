"""The command without what it needs: its version, and one line that says what to install."""

import importlib
import subprocess
import sys
import tomllib
from importlib.metadata import version
from pathlib import Path

import pytest

import innerattn
from innerattn import _core
from innerattn.cli.main import main
from innerattn.errors import EXTRA_OF, MissingLibraryError

ROOT = Path(__file__).parents[2]


def without(libraries: tuple[str, ...], code: str) -> "subprocess.CompletedProcess[str]":
    """A program in a Python that lacks some libraries."""
    code = f"import sys; sys.modules.update(dict.fromkeys({libraries!r}))\n{code}"
    command = [sys.executable, "-c", code]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def command(libraries: tuple[str, ...], *arguments: str) -> "subprocess.CompletedProcess[str]":
    start = "from innerattn.cli.start import main; sys.exit(main(sys.argv[1:]))"
    return without(libraries, f"sys.argv[1:] = {list(arguments)!r}; {start}")


def test_there_is_one_version() -> None:
    cargo = tomllib.loads((ROOT / "Cargo.toml").read_text("utf-8"))
    wanted = cargo["workspace"]["package"]["version"]
    assert innerattn.__version__ == _core.__version__ == version("innerattn") == wanted
    done = command(tuple(EXTRA_OF), "--version")
    assert (done.returncode, done.stdout) == (0, f"innerattn {wanted}\n"), done.stderr


@pytest.mark.parametrize("library", ["tyro", "rich"])
def test_without_its_libraries_the_command_says_what_to_install(library: str) -> None:
    done = command((library,), "train")
    wanted = f"innerattn: error: the command needs {library}: pip install {library}\n"
    assert (done.returncode, done.stdout, done.stderr) == (1, "", wanted)


@pytest.mark.long
@pytest.mark.parametrize(("ended", "out"), [(130, "said\n"), (0, "said\nfreed\n")])
def test_what_was_interrupted_does_not_wait_for_pythons_end(ended: int, out: str) -> None:
    code = f"""
import atexit, importlib, sys
atexit.register(print, "freed")
def run(_):
    print("said")
    return {ended}
importlib.import_module("innerattn.cli.main").main = run
from innerattn.cli.start import main
sys.exit(main())
"""
    done = without((), code)
    assert (done.returncode, done.stdout, done.stderr) == (ended, out, "")


def test_a_library_that_is_missed_later_is_named_too(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def run(_: object) -> int:
        raise ModuleNotFoundError("No module named 'torch'", name="torch.nn")

    monkeypatch.setattr("innerattn.cli.info.Info.run", run)
    assert main(["info"]) == 1
    wanted = "innerattn: error: the command needs torch: pip install 'innerattn[train]'\n"
    assert capsys.readouterr().err == wanted


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "library", "extra"),
    [
        ("parallel_env", "pettingzoo", "gym"),
        ("env", "pettingzoo", "gym"),
        ("RescueEnv", "gymnasium", "gym"),
        ("RescueVectorEnv", "gymnasium", "gym"),
        ("RescueTorchRLEnv", "tensordict", "torchrl"),
        ("RescueTorchRLEnv", "torch", "torchrl"),  # that extra brings both
    ],
)
def test_a_view_without_its_library_says_what_to_install(
    name: str, library: str, extra: str
) -> None:
    done = without(
        (library,), f"from innerattn.envs import BatchEnv; from innerattn.envs import {name}"
    )
    wanted = f"innerattn.envs.{name} needs {library}: pip install 'innerattn[{extra}]'"
    assert done.stderr.splitlines()[-1].endswith(f"MissingLibraryError: {wanted}")


def test_a_missing_library_is_an_import_error() -> None:
    assert issubclass(MissingLibraryError, ImportError)
    module = importlib.import_module("innerattn.envs")
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        module.nothing  # noqa: B018


def test_worlds_scripts_records_and_statistics_need_no_extra() -> None:
    """`tests/smoke.py` uses them for real, where no extra is installed."""
    rooms = "policies", "measures", "stats.bootstrap", "records.parquet", "envs.batch"
    code = "; ".join(f"import innerattn.{room}" for room in rooms)
    done = without((*EXTRA_OF, "rich", "statsmodels", "tyro"), f"{code}; print('there')")
    assert done.stdout == "there\n", done.stderr


def test_every_extra_brings_what_its_message_promises() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    extras = project["optional-dependencies"]
    asked = {"deploy", "gym", "log", "maps", "ray", "report", "search", "torchrl", "train"}
    assert asked | {"all", "dev"} <= extras.keys()
    for library, extra in EXTRA_OF.items():
        brought = " ".join(extras[extra]).replace("-", "_").replace("pillow", "PIL")
        assert library in brought or library == "tensordict", library  # TorchRL brings that
    assert set(extras["all"][0].removeprefix("innerattn[").removesuffix("]").split(",")) == asked
    everything = {
        one
        for name in ("gym", "maps", "report", "search", "torchrl", "train")
        for one in extras[name]
        if not one.startswith("innerattn")
    }
    assert everything <= set(extras["dev"])
