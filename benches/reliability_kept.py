"""What the rows of the scoreboard found last: a small file, from which the page's table is made."""

from __future__ import annotations

import fcntl
import json
import os
import subprocess
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from datetime import date
from pathlib import Path
from typing import Any

from page import system

from innerattn.config.files import write_whole

ROOT = Path(__file__).parents[1]
FILE = ROOT / "docs" / "records" / "reliability.json"
PAGE = ROOT / "docs" / "reliability.md"


@dataclass(frozen=True)
class Result:
    """What tests found.

    Attributes:
        passed: tests that passed.
        failed: tests that failed, and those that were skipped.
        measured: numbers that the tests recorded, by name.
        notes: what a reader of the page should know, in whole sentences.
    """

    passed: int
    failed: int
    measured: Mapping[str, list[float]] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Kept:
    """A result, with the names of its tests, and when, where and of which commit it was found."""

    result: Result
    tests: tuple[str, ...]
    date: str
    commit: str
    machine: str


def now(result: Result, tests: tuple[str, ...], commit: str) -> Kept:
    """A result of today and of this machine."""
    return Kept(result, tests, str(date.today()), commit, system("numpy", "torch"))


def commit() -> str:
    """The commit of the tree; a "+" says that files have changed since."""

    def git(*words: str) -> str:
        done = subprocess.run(["git", *words], cwd=ROOT, capture_output=True, text=True, check=True)
        return done.stdout.strip()

    results = [f":!{one.relative_to(ROOT)}" for one in (FILE, PAGE)]
    changed = git("status", "--porcelain", "--untracked-files=no", "--", ".", *results)
    return git("rev-parse", "--short=9", "HEAD") + ("+" if changed else "")


def read(file: Path) -> dict[str, Kept]:
    """All kept results by name; none without a file."""
    if not file.exists():
        return {}

    def kept(table: dict[str, Any]) -> Kept:
        found = table["result"]
        result = Result(**{**found, "notes": tuple(found["notes"])})
        return Kept(**{**table, "result": result, "tests": tuple(table["tests"])})

    return {name: kept(table) for name, table in json.loads(file.read_text("utf-8")).items()}


def keep(file: Path, name: str, kept: Kept) -> None:
    """Put one result into the file; the others stay, also while another process does the same."""
    with _alone(file.parent):
        every = {**read(file), name: kept}
        tables = {key: asdict(every[key]) for key in sorted(every)}
        write_whole(file, (json.dumps(tables, indent=1, ensure_ascii=False) + "\n").encode())


@contextmanager
def _alone(folder: Path) -> Iterator[None]:
    """One process at a time."""
    folder.mkdir(parents=True, exist_ok=True)
    handle = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX)
        yield
    finally:
        os.close(handle)
