"""What methods learn: trains every missing run, one core each, and tabulates scores over seeds.

`python benches/learning.py RUNS` fills its place in `docs/learning.md`, and another when given
`--warm-start hungarian`. A second call goes on where the first stopped; finished runs are kept.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import statistics
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from itertools import product
from pathlib import Path
from typing import Any

from page import LEARNING, publish, table

from innerattn.evaluate.statistics import student_interval

PRESETS = ("mixed", "double", "single")


def summary(
    runs: Path, preset: str, method: str, script: str, budget: str, seed: int
) -> dict[str, Any]:
    """The evaluation of a run, trained now if it is missing or was cut short."""
    begin = "" if script == "none" else f"-from-{script}"
    folder = runs / f"{preset}-{method}{begin}-{budget}-s{seed}"
    record = folder / "evaluation" / "summary.json"
    if not record.exists():
        shutil.rmtree(folder, ignore_errors=True)
        command = ["innerattn", "train", "--preset", preset, "--method", method]
        command += ["--warm-start", script, "--budget", budget, "--seed", str(seed)]
        command += ["--train.threads", "1"]
        environment = os.environ | {"OMP_NUM_THREADS": "1"}
        done = subprocess.run(
            [*command, "--run-dir", str(folder)], env=environment, capture_output=True, text=True
        )
        if done.returncode:
            sys.exit(f"{folder}: {done.stderr.strip()}")
        print(f"{folder} done", file=sys.stderr)
    found: dict[str, Any] = json.loads(record.read_text())
    return found


def row(found: list[dict[str, Any]]) -> list[str]:
    """Rescues, score, score of long episodes: mean over seeds with interval, and each seed's."""

    def over_seeds(values: list[float]) -> str:
        each = ", ".join(f"{value:.2f}" for value in values)
        half = ""
        if len(values) > 1:
            interval = student_interval(values)
            half = f" ± {interval.high - interval.mean:.2f}"
        return f"**{statistics.mean(values):.2f}**{half} ({each})"

    return [
        over_seeds([one["rescues_per_episode"]["mean"] for one in found]),
        over_seeds([one["score"]["mean"] for one in found]),
        over_seeds([one["long"]["score"]["mean"] for one in found]),
    ]


def main() -> None:
    """Train what is missing and publish the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("runs", type=Path, help="folder of the runs")
    parser.add_argument("--warm-start", default="none", choices=["none", "hungarian", "greedy"])
    parser.add_argument("--methods", nargs="+", default=["td-inner"])
    parser.add_argument("--budgets", nargs="+", default=["quick", "short"])
    parser.add_argument("--seeds", nargs="+", type=int, default=[0, 1, 2])
    parser.add_argument("--workers", type=int, default=os.cpu_count())
    given = parser.parse_args()
    cases = list(product(given.methods, given.budgets, PRESETS))
    with ThreadPoolExecutor(given.workers) as pool:
        runs = {
            (case, seed): pool.submit(
                summary, given.runs, case[2], case[0], given.warm_start, case[1], seed
            )
            for case in cases
            for seed in given.seeds
        }
        rows = [
            [f"{method}, {budget}, {preset}", *row([runs[case, s].result() for s in given.seeds])]
            for case in cases
            for method, budget, preset in [case]
        ]
    head = ["", "rescues, 25 steps", "score, 25 steps", "score, 100 steps"]
    section = "learning" if given.warm_start == "none" else "warm_start"
    publish(section, table(head, rows), LEARNING)


if __name__ == "__main__":
    main()
