"""The command `innerattn`: picks the command, runs it and turns errors into exit codes.

0 done, 1 failed with one line on standard error, 2 wrong usage, 130 interrupted.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from typing import Annotated, Any

import tyro

from innerattn.cli.evaluate import Evaluate
from innerattn.cli.info import Info
from innerattn.cli.options import UsageError
from innerattn.cli.reproduce import Reproduce
from innerattn.cli.robustness import Robustness
from innerattn.cli.train import command_type
from innerattn.errors import InnerattnError

_DESCRIPTION = "Train teams of unlike robots to rescue together, and measure how they do it."


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command.

    Args:
        argv: the arguments; none: those of the process.

    Returns:
        The exit code.

    Raises:
        SystemExit: help was asked for (code 0), or the options are wrong (code 2).
    """
    argv = list(sys.argv[1:] if argv is None else argv)
    try:
        return int(_parse(argv).run())
    except KeyboardInterrupt:
        print("innerattn: interrupted", file=sys.stderr)
        return 130
    except BrokenPipeError:  # the reader of our output has left, e.g. `innerattn info | head -1`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except (InnerattnError, OSError, MemoryError) as error:
        if "--debug" in argv:
            raise
        what = "out of memory: " if isinstance(error, MemoryError) else ""
        print(f"innerattn: error: {what}{' '.join(str(error).split())}", file=sys.stderr)
        return 2 if isinstance(error, UsageError) else 1


def _parse(argv: list[str]) -> Any:
    train = command_type(argv[1:] if argv[:1] == ["train"] else [])
    commands: Any = (
        Annotated[train, tyro.conf.subcommand("train")]
        | Annotated[Evaluate, tyro.conf.subcommand("evaluate")]
        | Annotated[Robustness, tyro.conf.subcommand("robustness")]
        | Annotated[Reproduce, tyro.conf.subcommand("reproduce")]
        | Annotated[Info, tyro.conf.subcommand("info")]
    )
    return tyro.cli(commands, args=argv, prog="innerattn", description=_DESCRIPTION)
