"""From the configuration's models to command-line options, one option per key.

It checks no value: the models do, when the options are put back into a configuration.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, make_dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import tyro
from pydantic import BaseModel
from pydantic.fields import FieldInfo
from rich.console import Console

from innerattn.cli.plain import PlainConsole
from innerattn.config import RunConfig
from innerattn.config.family import Family
from innerattn.config.model import OneOf
from innerattn.errors import ConfigError, InnerattnError, RunError

_SHORT = ("method", "warm_start", "seed", "device", "compile")
"""Keys of the section `train` that are options by their last word too."""

_FILE_ONLY = frozenset(
    {
        "scenario.robots",
        "scenario.tasks",
        "scenario.obstacles",
        "scenario.map",
        "scenario.faults",
        "train.schedule",
    }
)
"""Keys that hold tables, which only a TOML file can say well."""

OptionField = tuple[str, Any, Any]
"""Name, type and default, as `dataclasses.make_dataclass` takes them."""


class UsageError(InnerattnError):
    """Options are written wrongly or contradict each other."""


@dataclass(kw_only=True)
class Command:
    """What every command has."""

    debug: tyro.conf.FlagCreatePairsOff[bool] = False
    """Show where in the program an error arose."""
    help_all: tyro.conf.FlagCreatePairsOff[bool] = False
    """Show every option, where --help shows the most used."""


@dataclass(kw_only=True)
class LongCommand(Command):
    """What every command that takes minutes has, too."""

    quiet: Annotated[tyro.conf.FlagCreatePairsOff[bool], tyro.conf.arg(aliases=["-q"])] = False
    """Print warnings, errors and one line with the result, and nothing else."""

    def console(self) -> Console:
        """Where tables and announcements go; with --quiet they go nowhere."""
        return PlainConsole(markup=False, highlight=False, quiet=self.quiet)

    def progress_console(self) -> Console:
        """Where progress is shown: standard error, or nowhere."""
        return PlainConsole(stderr=True, quiet=self.quiet)

    def say_result(self, line: str) -> None:
        """Print the one line of --quiet."""
        if self.quiet:
            print(line, flush=True)


@contextmanager
def option_values() -> Iterator[None]:
    """Inside the block, what is not valid was said by options: it is wrong usage.

    Raises:
        UsageError: in place of a `ConfigError`.
    """
    try:
        yield
    except ConfigError as error:
        raise UsageError(str(error)) from error


def check_seed(seed: int | None, bits: int = 63) -> None:
    """Refuse a seed that is negative or has more than ``bits`` bits.

    Raises:
        UsageError: it is or has.
    """
    if seed is not None and not 0 <= seed < 2**bits:
        raise UsageError(f"--seed {seed}: must be 0 to 2**{bits} - 1")


def check_target(path: Path) -> None:
    """Refuse in time what no file can be written to; - is standard output.

    Raises:
        RunError: it is something else than a file, such as a link, or lies in no folder.
    """
    if path == Path("-"):
        return
    if not path.parent.is_dir():
        raise RunError(f"{path.parent}: no such folder")
    if path.is_dir():
        raise RunError(f"{path}: is a folder; must be a file")
    if not os.access(path.parent, os.W_OK):
        raise RunError(f"{path.parent}: nothing can be written there")
    if os.path.lexists(path) and (path.is_symlink() or not path.is_file()):
        raise RunError(f"{path}: is no plain file, and would be replaced; - is standard output")


def short_option(name: str, default: object) -> OptionField:
    """An option for key ``name`` of the section `train`."""
    info = type(RunConfig().train).model_fields[name]
    note = tyro.conf.arg(aliases=[_in_train(name)], help=info.description)
    return name, Annotated[_type_of(info), note], field(default=default)


def _in_train(name: str) -> str:
    """The long name of a key of the section `train`, with dashes, as of every other option."""
    return f"--train.{name.replace('_', '-')}"


def run_options(defaults: RunConfig) -> list[OptionField]:
    """Options for every key of a run, with ``defaults``, as fields of a dataclass for tyro."""
    options = [short_option(name, getattr(defaults.train, name)) for name in _SHORT]
    for section, values in _sections(defaults):
        kind: Any = _section_type(section, values)
        options.append((section, kind, field(default_factory=kind)))
    return options


def changed(command: object, defaults: RunConfig) -> dict[str, object]:
    """The values of a parsed command that differ from ``defaults``, by dotted key."""
    values = {f"train.{name}": getattr(command, name) for name in _SHORT}
    for section, _ in _sections(defaults):
        given = vars(getattr(command, section))
        values |= {f"{section}.{name}": value for name, value in given.items()}
    before = defaults.model_dump()
    return {
        key: value
        for key, value in values.items()
        if value != before[key.split(".")[0]][key.split(".")[1]]
    }


def _sections(defaults: RunConfig) -> list[tuple[str, BaseModel]]:
    """All sections but that of a family, which has an option of its own and a file."""
    return [(name, values) for name, values in defaults if name != Family.place]


def _type_of(info: FieldInfo) -> Any:
    """The type of a key; a word of a list that extensions may add to is one of today's list."""
    for note in info.metadata:
        if isinstance(note, OneOf):
            return Literal[tuple(note.words())]
    return info.annotation


def _section_type(section: str, defaults: BaseModel) -> type:
    options: list[OptionField] = [
        (
            name,
            Annotated[_type_of(info), tyro.conf.arg(help=info.description)],
            field(default=getattr(defaults, name)),
        )
        for name, info in type(defaults).model_fields.items()
        if f"{section}.{name}" not in _FILE_ONLY and not (section == "train" and name in _SHORT)
    ]
    kind = make_dataclass(f"{section.title()}Options", options, kw_only=True)
    kind.__doc__ = (type(defaults).__doc__ or "").split("\n")[0]
    return kind
