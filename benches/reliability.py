"""The scoreboard of reliability: runs the tests behind each row in full, and writes the table.

`python benches/reliability.py` fills its place in `docs/reliability.md`; `make test` runs a short
form of the same tests. `--rows "exact resume" "disk full"` runs some rows and prints them.
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
import tempfile
import time
import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median

from page import machine
from reliability_rows import ROWS, Row

from innerattn.report.marks import fill
from innerattn.report.table import columns, markdown, plain_table

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "reliability.md"
FUZZ_SECONDS = "60"


@dataclass(frozen=True)
class Result:
    """What a row's tests found: how many passed and failed, and what they measured, by name."""

    passed: int
    failed: int
    seconds: float
    measured: Mapping[str, list[float]] = field(default_factory=dict)


def run_row(row: Row) -> Result:
    """Run all tests of a row, the slow ones too."""
    start, passed, failed = time.perf_counter(), 0, 0
    measured: dict[str, list[float]] = {}
    env = {**os.environ, "INNERATTN_SLOW": "1", "INNERATTN_FUZZ_SECONDS": FUZZ_SECONDS}
    if row.python:
        with tempfile.TemporaryDirectory() as folder:
            report = Path(folder) / "report.xml"
            command = [sys.executable, "-m", "pytest", "-q", "-m", "slow or not slow"]
            command += ["-o", "junit_family=xunit1"]  # the later form knows no properties of tests
            subprocess.run([*command, f"--junit-xml={report}", *row.python], cwd=ROOT, env=env)
            suite = ET.parse(report).getroot().find("testsuite")
        assert suite is not None, "pytest wrote no report"
        for one in suite.iter("property"):
            measured.setdefault(one.attrib["name"], []).append(float(one.attrib["value"]))
        count = {
            key: int(suite.get(key, "0")) for key in ("tests", "failures", "errors", "skipped")
        }
        bad = count["failures"] + count["errors"] + count["skipped"]  # a skipped test is no proof
        passed, failed = passed + count["tests"] - bad, failed + bad
    if row.rust:
        command = ["cargo", "test", "--quiet", "--locked", "--test", "worlds", "--", *row.rust]
        done = subprocess.run(command, cwd=ROOT, env=env, capture_output=True, text=True)
        found = re.search(r"(\d+) passed; (\d+) failed", done.stdout)
        ran = (int(found[1]), int(found[2])) if found else (0, 1)
        passed, failed = passed + ran[0], failed + ran[1]
    return Result(passed, failed, time.perf_counter() - start, measured)


def line_of(row: Row, result: Result | None) -> list[str]:
    """A line of the table; without a result it says that the row was not run in full."""
    what = row.what + (f" Not tested: {row.missing}." if row.missing else "")
    if result is None:
        return [row.name, what, "not run in full", "", ""]
    for name, values in sorted(result.measured.items()):
        what += f" Median of {len(values)} {name}: {median(values):.2f}, longest {max(values):.2f}."
    holds = "yes" if result.passed and not result.failed and not row.missing else "**no**"
    tests = f"{result.passed}" + (f", {result.failed} failed" if result.failed else "")
    return [row.name, what, holds, tests, f"{result.seconds:,.0f} s"]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the rows, print each, and fill the page where all ran."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rows", nargs="+", choices=[row.name for row in ROWS], default=None)
    parser.add_argument("--list", action="store_true", help="fill the page and run nothing")
    options = parser.parse_args(arguments)
    if options.list:
        _publish([line_of(row, None) for row in ROWS])
        return 0
    chosen, lines = options.rows, []
    for row in ROWS:
        if chosen is None or row.name in chosen:
            lines.append(line_of(row, run_row(row)))
            print(" | ".join(lines[-1]), flush=True)
    if chosen is None:
        _publish(lines)
    return int(any("no" in line[2] for line in lines))


def _publish(lines: list[list[str]]) -> None:
    heads = columns(["row", "what holds", "holds?"], ["tests", "time"])
    about = f"{machine('numpy', 'torch')}.\n\n" if any(line[3] for line in lines) else ""
    fill(PAGE, "scoreboard", about + markdown(plain_table(heads, lines)))


if __name__ == "__main__":
    sys.exit(main())
