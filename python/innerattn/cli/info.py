"""`innerattn info`: what is installed, and whether the file of a scenario or instances is valid."""

from __future__ import annotations

import ctypes
import platform
import sys
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Literal

import tomli_w

from innerattn.cli.options import Command
from innerattn.config import BUDGETS, SCENARIOS, Scenario
from innerattn.cores import usable_cores
from innerattn.errors import ConfigError
from innerattn.zoo import zoo_names

_PACKAGES = ("torch", "numpy", "pydantic", "gymnasium", "pettingzoo")


@dataclass(kw_only=True)
class Info(Command):
    """Show versions, threads, device and presets, or check a file."""

    scenario: Path | None = None
    """TOML file with a scenario: check it, print it with all defaults, and draw its arena."""
    instance: str | None = None
    """JSON file with instances, or ral or standard, and a name, as in ral:ral_03: check the file
    and describe the instance (without a name the first): a world as --scenario does, or points
    with a plan of a second."""
    schema: Literal["scenario", "run", "study"] | None = None
    """Print the JSON Schema of the file of a scenario, a run or a study, for editors."""

    def run(self) -> int:
        """Print the answer.

        Returns:
            The exit code, 0.

        Raises:
            ConfigError: the file of a scenario or of instances is not valid, or several are asked
                for.
        """
        names = ("scenario", "instance", "schema")
        asked = [f"--{name}" for name in names if getattr(self, name) is not None]
        if len(asked) > 1:
            raise ConfigError(f"{' and '.join(asked)}: must be one of them at a time")
        if self.instance is not None:
            _show_instance(self.instance)
            return 0
        if self.schema == "study":
            from innerattn.studies.schema import study_schema_text

            print(study_schema_text(), end="")
            return 0
        if self.schema is not None:
            from innerattn.config.schema import schema_text

            print(schema_text(self.schema), end="")
            return 0
        if self.scenario is not None:
            _show_scenario(Scenario.from_toml(self.scenario))
            return 0
        rows = {"innerattn": _version("innerattn"), "python": platform.python_version()}
        rows |= {name: _version(name) for name in _PACKAGES}
        rows["threads"] = str(usable_cores())
        rows["device"] = _device()
        rows["presets"] = ", ".join(SCENARIOS)
        rows["budgets"] = ", ".join(BUDGETS)
        rows["zoo"] = ", ".join(zoo_names())
        for name, value in rows.items():
            print(f"{name:<11}{value}")
        return 0


def _show_scenario(scenario: Scenario) -> None:
    """The file with all keys, a map and a few sentences, as a file that can be used again.

    On a screen alone the cells of a large map are joined: that is said, and is a comment.
    """
    from innerattn.report.scenario_map import map_for_screen, scenario_map
    from innerattn.report.scenario_words import scenario_words

    values = scenario.model_dump(exclude_none=True)
    joined = None
    if scenario.map is not None and sys.stdout.isatty():
        joined = map_for_screen(scenario.map)
    if joined is None:
        print(tomli_w.dumps(values))
    else:
        values["map"]["rows"] = []
        hint = "a file gets all rows: innerattn info --scenario FILE > OTHER"
        shown = f"{_commented(joined)}\n# {hint}"
        print(tomli_w.dumps(values).replace("\nrows = []\n", f"\n{shown}\n", 1))
    for text in (scenario_map(scenario), scenario_words(scenario)):
        print(_commented(text))


def _commented(text: str) -> str:
    return "\n".join(f"# {line}".rstrip() for line in text.splitlines())


def _show_instance(written: str) -> None:
    from innerattn.config.instances import WorldInstance, named_instance
    from innerattn.policies.scripted.planner import plan
    from innerattn.report.tables.instances import instance_words, world_line

    instance = named_instance(written)
    if isinstance(instance, WorldInstance):
        _show_scenario(instance.scenario)
        print(f"# {world_line(instance)}")
    else:
        print(instance_words(instance, plan(instance)))


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"


def _device() -> str:
    """The fastest device; torch, slow to load, is asked only where there is a CUDA driver."""
    try:
        ctypes.CDLL("libcuda.so.1")
    except OSError:
        return "cpu"
    import torch

    return f"cuda ({torch.cuda.get_device_name()})" if torch.cuda.is_available() else "cpu"
