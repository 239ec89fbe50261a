"""Compares what an installed `innerattn` does elsewhere with what it does here.

usage: python packages/wheels/compare.py [--export FOLDER] [COMMAND ...]

It runs `trial.py` with this Python, and compares digests of worlds with those that
`tests/cross/digests.json` keeps. With COMMAND, which starts another Python, it runs `trial.py` with
that one, too, and compares both. ``--export`` adds a team that `innerattn export` wrote. The exit
code is 1 where something differs.
"""

from __future__ import annotations

import argparse
import json
import os
import shlex
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
KEPT = ROOT / "tests" / "cross" / "digests.json"
MOST_LOGIT_SHARE = 1e-5
"""How much logits may differ, as a share of the largest: what `innerattn export` allows, too."""


def trial(
    python: Sequence[str], export: Path | None, env: Mapping[str, str] | None = None
) -> dict[str, Any]:
    """What `trial.py` finds when a Python runs it.

    Args:
        python: the command that starts the Python.
        export: a team, or None.
        env: what the Python finds in its environment beside what is in this one.

    Raises:
        SystemExit: it failed; what it said is on standard error.
    """
    command = [*python, str(Path(__file__).with_name("trial.py"))]
    command += [] if export is None else [str(export)]
    done = subprocess.run(command, env={**os.environ, **(env or {})}, stdout=subprocess.PIPE)
    if done.returncode:
        raise SystemExit(f"The trial failed: {shlex.join(command)}")
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def kept() -> dict[str, str]:
    """SHA-256 of the worlds of the tests, by the name of the scenario."""
    rows = json.loads(KEPT.read_text("utf-8"))["rows"]
    return {row["name"]: row["sha256"] for row in rows}


def differences(found: Mapping[str, Any], expected: Mapping[str, Any]) -> list[str]:
    """Where a trial is not as it must be, in one line for each place.

    Args:
        found: by a trial.
        expected: by another one, or the part of it that is known.
    """
    wrong = []
    for part in ("kept", "presets"):
        for name, digest in expected.get(part, {}).items():
            if found[part].get(name) != digest:
                wrong.append(f"{part}: the worlds {name!r} do something else")
    if "team" not in expected:
        return wrong
    mine, other = found["team"], expected["team"]
    for part in ("actions", "observations"):
        if mine[part] != other[part]:
            wrong.append(f"the team has other {part}")
    logits, wanted = (
        np.frombuffer(bytes.fromhex(one["logits"]), "<f4").astype(float) for one in (mine, other)
    )
    if len(logits) != len(wanted):
        wrong.append("the team has other numbers of logits")
    elif not np.abs(logits - wanted).max() <= MOST_LOGIT_SHARE * np.abs(wanted).max():
        wrong.append(f"a logit differs by {np.abs(logits - wanted).max():.1g}")
    return wrong


def say(found: Mapping[str, Any]) -> None:
    """Print where a trial ran, and what it did."""
    print(f"{found['where']}: {found['module']}")
    print(f"  {len(found['kept'])} kept scenarios, {len(found['presets'])} presets", end="")
    if "team" in found:
        team = found["team"]
        print(
            f", {len(team['actions']):,} actions of a team, {team['call_us']:.0f} µs a call", end=""
        )
    print(flush=True)


def compare(
    python: Sequence[str], export: Path | None, env: Mapping[str, str] | None = None
) -> list[str]:
    """Run the trial here and with a Python, if one is given; print both, and return what differs.

    Raises:
        SystemExit: as of `trial`.
    """
    here = trial([sys.executable], export)
    say(here)
    wrong = differences(here, {"kept": kept()})
    if python:
        there = trial(python, export, env)
        say(there)
        wrong += differences(there, {**here, "kept": kept()})
    return wrong


def report(wrong: Sequence[str]) -> int:
    """Print what differs; the exit code."""
    print(*(wrong or ["All is the same."]), sep="\n")
    return int(bool(wrong))


def main() -> int:
    """Compare what the command line names; the exit code."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--export", type=Path)
    parser.add_argument("python", nargs=argparse.REMAINDER, metavar="COMMAND")
    options = parser.parse_args()
    return report(compare(options.python, options.export))


if __name__ == "__main__":
    sys.exit(main())
