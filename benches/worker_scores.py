"""Scores of teams that one, two and four workers have trained, with the budget `fast` in `mixed`.

`python benches/worker_scores.py` trains three seeds each and fills a table of `docs/scale.md`. Runs
that are done are kept in the folder given by --runs, so that it can go on after a stop.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from pathlib import Path
from statistics import mean

from page import machine, publish, table
from worker_speed import PAGE

METHODS = ("ppo-inner", "mappo", "td-inner")
WORKERS = (1, 2, 4)
SEEDS = (0, 1, 2)


def score(method: str, workers: int, seed: int, runs: Path) -> float:
    """The score of one team."""
    run = runs / f"{method}-{workers}-s{seed}"
    summary = run / "evaluation" / "summary.json"
    if not summary.exists():
        options = {
            "--method": method,
            "--budget": "fast",
            "--seed": str(seed),
            "--train.workers": str(workers),
            "--train.threads": "1",
            "--run-dir": str(run),
        }
        words = [word for pair in options.items() for word in pair]
        subprocess.run([sys.executable, "-m", "innerattn", "train", "--quiet", *words], check=True)
    found: float = json.loads(summary.read_text())["score"]["mean"]
    return found


def main() -> None:
    """Train, print, and fill the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=Path, default=Path("runs/worker-scores"))
    parser.add_argument("--methods", nargs="+", default=METHODS)
    given = parser.parse_args()
    rows = []
    for method in given.methods:
        first = 0.0
        for workers in WORKERS:
            scores = [score(method, workers, seed, given.runs) for seed in SEEDS]
            first = first or mean(scores)
            values = ", ".join(f"{one:.2f}" for one in scores)
            change = "" if workers == 1 else f"{mean(scores) - first:+.3f}"
            rows.append((method, str(workers), f"{mean(scores):.3f}", values, change))
    head = (
        "`fast` in mixed",
        "workers",
        "score, mean of 3 seeds",
        "seeds 0, 1, 2",
        "to one worker",
    )
    publish("worker_scores", f"{table(head, rows)}\n\n{machine('torch')}.", PAGE)


if __name__ == "__main__":
    main()
