"""The scoreboard of reliability: runs the tests behind each row in full, and writes the table.

`python benches/reliability.py` runs every row; `--rows "exact resume" "disk full"` some. Each
result is kept in `docs/records/reliability.json` as soon as it is there, and the table of
`docs/reliability.md` is made from that file. `make test` runs a short form of the same tests.
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from statistics import median

from reliability_kept import FILE, PAGE, ROOT, Kept, Result, commit, keep, now, read
from reliability_rows import ROWS, Row

from innerattn.report.marks import fill
from innerattn.report.table import columns, markdown, plain_table

FUZZ_SECONDS = "60"


def run_row(row: Row) -> Result:
    """Run all tests of a row, the slow ones too."""
    env = {**os.environ, "INNERATTN_SLOW": "1", "INNERATTN_FUZZ_SECONDS": FUZZ_SECONDS}
    passed = failed = 0
    measured: dict[str, list[float]] = {}
    if row.python:
        passed, failed = _run_python(row.python, env, measured)
    if row.rust:
        ran = _run_rust(row.rust, env)
        passed, failed = passed + ran[0], failed + ran[1]
    return Result(passed, failed, measured)


def _run_python(
    tests: Sequence[str], env: Mapping[str, str], measured: dict[str, list[float]]
) -> tuple[int, int]:
    """How many passed and failed; what they record goes into ``measured``."""
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder) / "report.xml"
        command = [sys.executable, "-m", "pytest", "-q", "-m", "slow or not slow"]
        command += ["-o", "junit_family=xunit1"]  # the later form knows no properties of tests
        subprocess.run([*command, f"--junit-xml={report}", *tests], cwd=ROOT, env=env)
        suite = ET.parse(report).getroot().find("testsuite") if report.exists() else None
    if suite is None:  # the process of the tests died
        return 0, 1
    for one in suite.iter("property"):
        with suppress(ValueError):  # libraries add texts of their own
            value = float(one.attrib["value"])
            measured.setdefault(one.attrib["name"], []).append(value)
    count = {key: int(suite.get(key, "0")) for key in ("tests", "failures", "errors", "skipped")}
    bad = count["failures"] + count["errors"] + count["skipped"]  # a skipped test is no proof
    return count["tests"] - bad, bad


def _run_rust(tests: Sequence[str], env: Mapping[str, str]) -> tuple[int, int]:
    """How many passed and failed; no test at all is a failure."""
    command = ["cargo", "test", "--quiet", "--locked", "-p", "innerattn-env", "--test", "worlds"]
    command += ["--", *tests]
    done = subprocess.run(command, cwd=ROOT, env=env, capture_output=True, text=True)
    if done.returncode:
        print(done.stdout, done.stderr, sep="\n", file=sys.stderr)
    found = re.search(r"(\d+) passed; (\d+) failed", done.stdout)
    if not found or not int(found[1]) + int(found[2]):
        return 0, 1
    return int(found[1]), int(found[2])


def line_of(row: Row, every: Mapping[str, Kept]) -> list[str]:
    """A line of the table, of what was kept; a result of other tests does not count."""
    needed = {row.name: row.tests} if row.tests else {}
    needed |= {name: (name,) for name in row.long}
    there = {name: tests for name, tests in needed.items() if name in every}
    kept = [every[name] for name, tests in there.items() if every[name].tests == tests]
    missing = [row.missing] if row.missing else []
    missing += [f"`{name}`" for name in row.long if name not in there]
    notes = [note for one in kept for note in (*one.result.notes, *_spread(one.result.measured))]
    what = " ".join([row.what, *notes, *(f"Not tested: {one}." for one in missing)])
    if not needed:
        return [row.name, what, "not tested", "", ""]
    if not kept or (row.tests and kept[0].tests != row.tests):
        return [row.name, what, "not run in full", "", ""]
    passed = sum(one.result.passed for one in kept)
    failed = sum(one.result.failed for one in kept)
    holds = "**no**" if failed or not passed else "in part" if missing else "yes"
    tests = f"{passed}" + (f", {failed} failed" if failed else "")
    when = "; ".join(dict.fromkeys(f"{one.date}, {one.commit}" for one in kept))
    return [row.name, what, holds, tests, when]


def _spread(measured: Mapping[str, Sequence[float]]) -> list[str]:
    """Median and largest of the numbers that tests recorded, a sentence for each name."""
    return [
        f"{name[0].upper()}{name[1:]}: median {median(found):.2f}, longest {max(found):.2f}."
        for name, found in sorted(measured.items())
    ]


def publish(file: Path, page: Path) -> None:
    """Make the table of the page from what was kept."""
    every = read(file)
    lines = [line_of(row, every) for row in ROWS]
    heads = columns(["row", "what holds", "holds?"], ["tests", "found"])
    text = markdown(plain_table(heads, lines))
    machines = sorted({one.machine for one in every.values()})
    fill(page, "scoreboard", "\n\n".join([*(f"{one}." for one in machines), text]))


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the rows; keep each result and renew the page as soon as it is there."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rows", nargs="+", choices=[row.name for row in ROWS], default=None)
    parser.add_argument("--list", action="store_true", help="renew the page and run nothing")
    options = parser.parse_args(arguments)
    holds = True
    for row in ROWS:
        if options.list or not row.tests or row.name not in (options.rows or [row.name]):
            continue
        before = commit()
        keep(FILE, row.name, now(run_row(row), row.tests, before))
        publish(FILE, PAGE)
        line = line_of(row, read(FILE))
        print(" | ".join(line), flush=True)
        holds = holds and line[2] != "**no**"
    publish(FILE, PAGE)
    return int(not holds)


if __name__ == "__main__":
    sys.exit(main())
