"""`innerattn new scenario|study NAME`: a commented file to begin with."""

from __future__ import annotations

import os
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from innerattn.cli.options import Command, UsageError, check_target
from innerattn.config.files import write_whole
from innerattn.config.new_scenario import new_scenario
from innerattn.errors import RunError


@dataclass(kw_only=True)
class New(Command):
    """Write the file of a scenario or of a study, with comments, to begin with."""

    what: Annotated[
        tyro.conf.Positional[Literal["scenario", "study"]],
        tyro.conf.arg(metavar="scenario|study"),
    ]
    """What to begin."""
    name: Annotated[tyro.conf.Positional[str], tyro.conf.arg(metavar="NAME")]
    """Name of the scenario or study; the file is NAME.toml here."""

    def run(self) -> int:
        """Write the file and say what to do with it.

        Returns:
            The exit code, 0.

        Raises:
            InnerattnError: the name cannot be that of a file, or the file is there already.
            OSError: the file cannot be written.
        """
        name = self.name.removesuffix(".toml")
        if not re.fullmatch(r"[A-Za-z0-9_-]{1,64}", name):
            raise UsageError(f"{self.name}: must be 1 to 64 letters, digits, '_' or '-'")
        path = Path(f"{name}.toml")
        if os.path.lexists(path):
            raise RunError(f"{path}: is there already; nothing was written")
        check_target(path)
        if self.what == "study":
            from innerattn.studies.new_study import new_study

            write_whole(path, new_study(name, path.name).encode())
            print(f"{path}: a study of one scenario and one method; edit it, then")
            print(f"  innerattn study run {path}    trains, measures and compares its runs")
            return 0
        write_whole(path, new_scenario(name, path.name).encode())
        print(f"{path}: a scenario with all defaults; edit it, then")
        print(f"  innerattn info --scenario {path}     checks and draws it")
        print(f"  innerattn train --scenario {path}    trains a team in it")
        return 0
