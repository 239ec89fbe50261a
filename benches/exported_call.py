"""What one call of an exported team costs: readings or a row to an action, on one core.

`python benches/exported_call.py` fills its place in `docs/deployment.md`, with medians of three
runs of teams of the zoo. Each run is a process of its own on one thread, with rounds of a few
calls. The time of the thread on the core is the median round's. The time of the clock is the least
round's: other programs lengthen it, and can only lengthen it.
`python benches/exported_call.py EXPORT` is one run, of a team that `innerattn export` wrote.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory

from page import machine, publish, table

from innerattn.policies.exported import Exported

PAGE = Path(__file__).parents[1] / "docs" / "deployment.md"
TEAMS = ("zoo:mixed", "zoo:mixed-16", "zoo:any")
RUNS, ROUNDS, CALLS = 3, 400, 20
HEAD = ["team", "robots", "backend", "given", "clock [µs]", "core [µs]"]


def main() -> None:
    """One run of a team that was exported, or three of each team, published."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("export", type=Path, nargs="?")
    export = parser.parse_args().export
    if export is not None:
        print(json.dumps(costs(export)))
        return
    rows = [row for team in TEAMS for row in rows_of(team)]
    publish("exported_call", f"{machine('numpy', 'onnxruntime')}.\n\n{table(HEAD, rows)}", PAGE)


def rows_of(team: str) -> list[list[str]]:
    """The rows of the table about one team: medians of `RUNS` runs."""
    with TemporaryDirectory() as work:
        export = Path(work) / "export"
        innerattn = [sys.executable, "-m", "innerattn", "export", team, "-o", str(export)]
        subprocess.run(innerattn, check=True)
        run = [sys.executable, __file__, str(export)]
        one_thread = os.environ | dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
        texts = [
            subprocess.run(run, check=True, capture_output=True, text=True, env=one_thread).stdout
            for _ in range(RUNS)
        ]
        robots = len(Exported(export).robot_names)
    rows = []
    for same in zip(*(json.loads(text) for text in texts), strict=True):
        backend, given, *_ = same[0]
        found = [f"{median(one[place] for one in same):.0f}" for place in (2, 3)]
        rows.append([f"`{team}`", str(robots), backend, given, *found])
    return rows


def costs(export: Path) -> list[tuple[str, str, float, float]]:
    """Backend, what is given, and the two times of a call [µs], for all pairs of the first two."""
    found = []
    contract = Exported(export, backend=None).contract
    has_onnx = any(name.endswith(".onnx") for name in contract.files)
    for backend in ("onnxruntime", "numpy") if has_onnx else ("numpy",):
        team = Exported(export, backend=backend)
        robot, *others = team.robot_names
        body = {"position": (0.1, 0.2), "velocity": (0.0, 0.3), "time": 1.0}
        readings = {
            "now": 1.05,
            "own": body,
            "teammates": dict.fromkeys(others, body),
            "victims": [{"task": team.contract.tasks[0].name, "position": (0.5, -0.4)}],
            "victims_time": 1.0,
        }
        row = team.row(robot, readings)
        for given, value in (("readings", readings), ("row", row)):
            found.append((backend, given, *cost_us(partial(team.decide, robot, value))))
    return found


def cost_us(call: Callable[[], object]) -> tuple[float, float]:
    """Time of a call [µs]: of the clock, in its best round, and of the core, in the median one."""
    clock, core = [], []
    for _ in range(ROUNDS + 1):
        began, began_core = time.perf_counter(), time.thread_time()
        for _ in range(CALLS):
            call()
        clock.append((time.perf_counter() - began) / CALLS * 1e6)
        core.append((time.thread_time() - began_core) / CALLS * 1e6)
    return min(clock[1:]), median(core[1:])


if __name__ == "__main__":
    main()
