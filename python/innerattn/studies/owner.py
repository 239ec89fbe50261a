"""Names the process that a claim belongs to, so that a worker beside it sees when it is gone."""

from __future__ import annotations

import os
from pathlib import Path

_PROC = Path("/proc")


def this_process() -> str:
    """The machine's boot, the space of process numbers, this process's number and start.

    Empty parts stand where the system does not tell them; then nobody takes it for gone.
    """
    return f"{_here()} {os.getpid()} {_start(os.getpid())}\n"


def is_gone(owner: str) -> bool:
    """Whether a process is gone for certain: it was one of this boot of this machine.

    Args:
        owner: what `this_process` gave there.
    """
    words = owner.split()
    if len(words) != 4 or not words[2].isdecimal():
        return False
    boot, space, number, start = words
    return f"{boot} {space}" == _here() and _start(int(number)) != start


def _here() -> str:
    try:
        boot = (_PROC / "sys/kernel/random/boot_id").read_text("ascii").strip()
        space = os.readlink(_PROC / "self/ns/pid")
    except OSError:
        return ""
    return f"{boot} {space}"


def _start(number: int) -> str:
    """When a process began, in ticks after boot; empty where there is none, or it has ended."""
    try:
        text = (_PROC / str(number) / "stat").read_text("utf-8", "replace")
    except OSError:
        return ""
    fields = text[text.rindex(")") + 1 :].split()
    return "" if fields[0] in ("Z", "X") else fields[19]
