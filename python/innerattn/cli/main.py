"""The command `innerattn`: picks the command, runs it and turns errors into exit codes.

0 done, 1 failed with one line on standard error, 2 wrong usage; 130, 143 and 129 interrupted by
Ctrl-C (SIGINT), SIGTERM and SIGHUP.
"""

from __future__ import annotations

import io
import os
import sys
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import reduce
from operator import or_
from typing import Annotated, Any

import tyro

from innerattn.cli.brief import print_brief
from innerattn.cli.completion import completion_script
from innerattn.cli.demo import Demo
from innerattn.cli.evaluate import Evaluate
from innerattn.cli.export import Export
from innerattn.cli.info import Info
from innerattn.cli.new import New
from innerattn.cli.options import UsageError
from innerattn.cli.page import Page
from innerattn.cli.plain import escaped_output
from innerattn.cli.play import Play
from innerattn.cli.replay import Replay
from innerattn.cli.report import Report
from innerattn.cli.reproduce import Reproduce
from innerattn.cli.robustness import Robustness
from innerattn.cli.seal import Seal
from innerattn.cli.streams import named_output
from innerattn.cli.study import Study
from innerattn.cli.train import command_type
from innerattn.cli.usage import parse, refuse, words_of
from innerattn.cli.watch import Watch
from innerattn.config.near import did_you_mean
from innerattn.cores import let_waiting_threads_sleep
from innerattn.errors import (
    MissingLibraryError,
    UnsealedRunWarning,
    missing_library,
    needs_no_traceback,
    one_line,
)
from innerattn.signals import exit_code, interrupt, requests_handled_by

_PROG = "innerattn"
_DESCRIPTION = (
    "Train, evaluate and inspect teams of different robots that rescue victims together. "
    "`innerattn --version` prints the version, `innerattn --completion bash` a script that "
    "completes commands and options in a shell."
)

COMMANDS: Mapping[str, Any] = {
    "demo": Demo,
    "train": None,  # its options follow from what is chosen, see `_type_of`
    "evaluate": Evaluate,
    "replay": Replay,
    "report": Report,
    "watch": Watch,
    "play": Play,
    "page": Page,
    "robustness": Robustness,
    "reproduce": Reproduce,
    "study": Study,
    "export": Export,
    "seal": Seal,
    "new": New,
    "info": Info,
}
"""What a user can do, by name, in the order in which help lists it."""


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
        with requests_handled_by(interrupt), _plain_warnings(), named_output():
            command = _parse(argv)
            with escaped_output():
                return int(command.run())
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
    if isinstance(error, ImportError) and str(error).startswith("pyarrow requires NumPy"):
        return MissingLibraryError(f"{error}: pip install 'pyarrow<20', or a newer NumPy")
    if not isinstance(error, ModuleNotFoundError):
        return error
    return missing_library("the command", error) or error


def _parse(argv: list[str]) -> Any:
    name, rest = (argv[0], argv[1:]) if argv else ("", [])
    if name in COMMANDS:
        command = _type_of(name, rest)
        if "--help-all" in rest:
            rest = ["--help"]
        elif {"-h", "--help"} & set(words_of(rest)) and print_brief(name, command):
            raise SystemExit(0)
        return parse(command, rest, f"innerattn {name}")
    if name == "--completion":
        print(completion_script(_every_command(), rest))
        raise SystemExit(0)
    if name in ("", "-h", "--help", "--help-all"):
        return tyro.cli(_every_command(), args=["--help"], prog=_PROG, description=_DESCRIPTION)
    known = ", ".join(COMMANDS)
    if name.startswith("-"):
        refuse(UsageError(f"{name}: a command must come first: {known}"))
    near = did_you_mean(name, COMMANDS)
    refuse(UsageError(f"{name}: unknown command{near or f'; commands are {known}'}"))


def _type_of(name: str, argv: Sequence[str]) -> Any:
    """The dataclass of a command's options; some have defaults that ``argv`` chooses."""
    return command_type(argv) if name == "train" else COMMANDS[name]


def _every_command() -> Any:
    """All commands as one type, for what shows all of them."""
    kinds = [Annotated[_type_of(name, []), tyro.conf.subcommand(name)] for name in COMMANDS]
    return reduce(or_, kinds)
