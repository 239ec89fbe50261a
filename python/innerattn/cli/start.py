"""Where the command `innerattn` begins: it is ready for Ctrl-C before anything slow is loaded.

It prints the version, and says what to install if it cannot start.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence

from innerattn.cli.streams import fill_missing_streams, named_output
from innerattn.errors import lacked_memory, missing_library, one_line
from innerattn.signals import (
    end_at_once,
    handle_requests,
    interrupt,
    is_of_interruption,
    leave,
)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command, or say in one line why it cannot start: a library or memory is lacking.

    Args:
        argv: the arguments; none: those of the process, which then ends at once if a signal asked
            for it.

    Returns:
        The exit code, as of `innerattn.cli.main.main`; 1 if it cannot start.
    """
    fill_missing_streams()
    handle_requests(leave)
    arguments = list(sys.argv[1:] if argv is None else argv)
    if arguments == ["--version"]:
        from innerattn import __version__

        try:
            with named_output():
                print(f"innerattn {__version__}")
        except OSError as error:
            print(f"innerattn: error: {one_line(error)}", file=sys.stderr)
            return 1
        return 0
    try:
        from innerattn.cli.main import main as run
    except ModuleNotFoundError as error:
        missing = missing_library("the command", error)
        if missing is None:
            raise
        print(f"innerattn: error: {missing}", file=sys.stderr)
        return 1
    except (ImportError, MemoryError, SystemError) as error:
        if not lacked_memory(error):
            raise
        print(f"innerattn: error: {one_line(error)}", file=sys.stderr)
        return 1
    handle_requests(interrupt)
    code = run(arguments)
    if argv is None and is_of_interruption(code):
        end_at_once(code)
    return code
