"""The rooms below the learner import no torch, scipy, tyro or rich, which are slow to import."""

import subprocess
import sys

import pytest

ROOMS = ("config", "envs", "records", "stats", "policies", "measures")

_IMPORT = """
import importlib, pkgutil, sys
room = importlib.import_module(sys.argv[1])
for module in pkgutil.walk_packages(room.__path__, f"{room.__name__}."):
    if module.name != "innerattn.envs.torchrl":  # the view for a library of torch
        importlib.import_module(module.name)
print(*({"torch", "scipy", "tyro", "rich"} & sys.modules.keys()))
"""


@pytest.mark.parametrize("room", ROOMS)
def test_no_module_of_the_room_imports_what_is_slow(room: str) -> None:
    command = [sys.executable, "-c", _IMPORT, f"innerattn.{room}"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == []


_FIRST = """
import importlib, pkgutil, sys
import innerattn.config as room
modules = [one.name for one in pkgutil.walk_packages(room.__path__, "innerattn.config.")]
for names, take in ((room.__all__, lambda one: getattr(sys.modules["innerattn.config"], one)),
                    (modules, importlib.import_module)):
    for name in names:
        for module in [one for one in sys.modules if one.startswith("innerattn.config")]:
            del sys.modules[module]
        importlib.import_module("innerattn.config")
        take(name)
"""


def test_every_name_of_the_configuration_may_be_asked_for_first() -> None:
    done = subprocess.run([sys.executable, "-c", _FIRST], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_the_check_finds_what_is_imported() -> None:
    command = [sys.executable, "-c", _IMPORT, "innerattn.nn"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert "torch" in done.stdout.split()


def test_gymnasium_and_pettingzoo_wait_until_their_view_is_asked_for() -> None:
    code = """
import sys
import innerattn.envs
early = {"gymnasium", "pettingzoo"} & set(sys.modules)
from innerattn.envs import parallel_env
print(sorted(early), {"gymnasium", "pettingzoo"} <= set(sys.modules), parallel_env.__name__)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[] True parallel_env\n"
