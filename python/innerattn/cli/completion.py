"""Scripts that complete commands and options in a shell."""

from __future__ import annotations

import io
from collections.abc import Sequence
from contextlib import redirect_stdout, suppress
from typing import Any

import tyro

from innerattn.cli.options import UsageError
from innerattn.cli.usage import refuse
from innerattn.config.near import did_you_mean

SHELLS = ("bash", "zsh", "fish")


def completion_script(commands: Any, words: Sequence[str]) -> str:
    """The script for the shell that ``words`` name.

    Args:
        commands: a union of all commands.
        words: one of `SHELLS`, and nothing else.

    Raises:
        SystemExit: they name no such shell (code 2).
    """
    if len(words) != 1 or words[0] not in SHELLS:
        given = " ".join(words)
        near = did_you_mean(given, SHELLS)
        refuse(
            UsageError(
                f"{' '.join(['--completion', *words])}: must be one of {', '.join(SHELLS)}{near}"
            )
        )
    script = io.StringIO()
    with redirect_stdout(script), suppress(SystemExit):
        tyro.cli(commands, args=["--tyro-print-completion", words[0]], prog="innerattn")
    return script.getvalue().rstrip()
