"""What methods learn: trains every missing run, one core each, and tabulates scores over seeds.

`python benches/learning.py RUNS` fills its place in `docs/learning.md`, and another when given
`--warm-start hungarian`. A second call goes on where the first stopped; finished runs are kept.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
from itertools import product
from pathlib import Path
from typing import Any

from page import LEARNING, publish, table
from runs import Run, train_all

from innerattn.evaluate.statistics import student_interval

PRESETS = ("mixed", "double", "single")


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
    wanted = [
        Run(preset, method, budget, seed, given.warm_start)
        for method, budget, preset in cases
        for seed in given.seeds
    ]
    folders = iter(train_all(wanted, given.runs, given.workers))
    rows = []
    for method, budget, preset in cases:
        records = [next(folders) / "evaluation" / "summary.json" for _ in given.seeds]
        found = [json.loads(record.read_text()) for record in records]
        rows.append([f"{method}, {budget}, {preset}", *row(found)])
    head = ["", "rescues, 25 steps", "score, 25 steps", "score, 100 steps"]
    section = "learning" if given.warm_start == "none" else "warm_start"
    publish(section, table(head, rows), LEARNING)


if __name__ == "__main__":
    main()
