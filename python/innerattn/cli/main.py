"""The command `innerattn`: picks the command, runs it and turns errors into exit codes.

0 done, 1 failed with one line on standard error, 2 wrong usage; 130, 143 and 129 interrupted by
Ctrl-C (SIGINT), SIGTERM and SIGHUP.
"""

from __future__ import annotations

import io
import os
import sys
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import Annotated, Any

import tyro

from innerattn.cli.evaluate import Evaluate
from innerattn.cli.info import Info
from innerattn.cli.options import UsageError
from innerattn.cli.play import Play
from innerattn.cli.replay import Replay
from innerattn.cli.report import Report
from innerattn.cli.reproduce import Reproduce
from innerattn.cli.robustness import Robustness
from innerattn.cli.seal import Seal
from innerattn.cli.train import command_type
from innerattn.cli.watch import Watch
from innerattn.cores import let_waiting_threads_sleep
from innerattn.errors import UnsealedRunWarning, missing_library, needs_no_traceback, one_line
from innerattn.signals import exit_code, interrupt, requests_handled_by

_DESCRIPTION = (
    "Train teams of unlike robots to rescue together, and measure how they do it. "
    "`innerattn --version` prints the version."
)


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
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # better a "?" than no table at all
    let_waiting_threads_sleep()
    try:
        with requests_handled_by(interrupt), _plain_warnings():
            return int(_parse(argv).run())
    except KeyboardInterrupt as request:
        with suppress(OSError):  # a lost terminal
            print("innerattn: interrupted", file=sys.stderr)
        return exit_code(request)
    except BrokenPipeError:  # the reader of our output has left, e.g. `innerattn info | head -1`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except Exception as raised:
        error = _named_by_its_extra(raised)
        if "--debug" in argv or not needs_no_traceback(error):
            raise
        print(f"innerattn: error: {one_line(error)}", file=sys.stderr)
        return 2 if isinstance(error, UsageError) else 1


@contextmanager
def _plain_warnings() -> Iterator[None]:
    """Show what we warn of in one line, as errors are."""
    shown = warnings.showwarning

    def show(message: Warning | str, category: type[Warning], *rest: Any, **more: Any) -> None:
        if issubclass(category, UnsealedRunWarning):
            print(f"innerattn: warning: {message}", file=sys.stderr)
        else:
            shown(message, category, *rest, **more)

    warnings.showwarning = show
    try:
        yield
    finally:
        warnings.showwarning = shown


def _named_by_its_extra(error: Exception) -> Exception:
    """What says how to install a module that was not found; any other error as it is."""
    if not isinstance(error, ModuleNotFoundError):
        return error
    return missing_library("the command", error) or error


def _parse(argv: list[str]) -> Any:
    train = command_type(argv[1:] if argv[:1] == ["train"] else [])
    commands: Any = (
        Annotated[train, tyro.conf.subcommand("train")]
        | Annotated[Evaluate, tyro.conf.subcommand("evaluate")]
        | Annotated[Replay, tyro.conf.subcommand("replay")]
        | Annotated[Report, tyro.conf.subcommand("report")]
        | Annotated[Watch, tyro.conf.subcommand("watch")]
        | Annotated[Play, tyro.conf.subcommand("play")]
        | Annotated[Robustness, tyro.conf.subcommand("robustness")]
        | Annotated[Reproduce, tyro.conf.subcommand("reproduce")]
        | Annotated[Seal, tyro.conf.subcommand("seal")]
        | Annotated[Info, tyro.conf.subcommand("info")]
    )
    return tyro.cli(commands, args=argv, prog="innerattn", description=_DESCRIPTION)
