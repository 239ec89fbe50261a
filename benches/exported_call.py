"""What one call of an exported team costs: readings or a row to an action, on one thread.

`OMP_NUM_THREADS=1 python benches/exported_call.py EXPORT` prints a table; EXPORT is what
`innerattn export` wrote.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

from page import machine, table

from innerattn.policies.exported import Exported

ROUNDS, CALLS = 41, 200


def cost_us(call: Callable[[], object]) -> list[float]:
    """Time of a call [µs], medians of the rounds: of the clock, and of the core's own work."""
    rounds = []
    for _ in range(ROUNDS + 1):
        start, began = time.perf_counter(), time.thread_time()
        for _ in range(CALLS):
            call()
        spent = (time.perf_counter() - start, time.thread_time() - began)
        rounds.append([one / CALLS * 1e6 for one in spent])
    return [statistics.median(one) for one in zip(*rounds[1:], strict=True)]


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("export", type=Path)
    export = parser.parse_args().export
    rows = []
    for backend in ("onnxruntime", "numpy"):
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
            found = cost_us(partial(team.decide, robot, value))
            rows.append([backend, given, *(f"{one:.0f}" for one in found)])
    print(f"{machine('numpy', 'onnxruntime')}\n")
    print(table(["backend", "given", "call [µs]", "of it on the core [µs]"], rows))


if __name__ == "__main__":
    main()
