"""Speed and scores of training with bfloat16 beside float32, with the budget `fast`.

`python benches/precision.py` trains three seeds of each and fills a table of `docs/performance.md`.
The two runs of a seed go at the same time, on a core each. Runs that are done are kept in the
folder given by --runs, so that it can go on after a stop.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from statistics import mean, median

from page import machine, publish, table

TRAININGS = (("mixed", "ppo-inner"), ("mixed", "mappo"))
PRECISIONS = ("float32", "bfloat16")
SEEDS = (0, 1, 2)


def folder(training: Sequence[str], precision: str, seed: int, runs: Path) -> Path:
    """Where a run is kept."""
    return runs / "-".join([*training, precision, f"s{seed}"])


def train(training: Sequence[str], seed: int, runs: Path) -> None:
    """Train what is not done yet of a seed, each precision on a core of its own."""
    preset, method = training
    cores = sorted(os.sched_getaffinity(0))
    jobs = []
    for place, precision in enumerate(PRECISIONS):
        run = folder(training, precision, seed, runs)
        if (run / "evaluation" / "summary.json").exists():
            continue
        options = {
            "--preset": preset,
            "--method": method,
            "--budget": "fast",
            "--seed": str(seed),
            "--network.precision": precision,
            "--train.workers": "1",
            "--train.threads": "1",
            "--run-dir": str(run),
        }
        words = [word for pair in options.items() for word in pair]
        core = str(cores[(place + seed) % len(cores)])
        command = ["taskset", "-c", core, sys.executable, "-m", "innerattn", "train", "--quiet"]
        jobs.append(subprocess.Popen([*command, *words]))
    ends = [job.wait() for job in jobs]
    if any(ends):
        sys.exit(f"{preset}, {method}, seed {seed}: a training failed")


def speed(run: Path) -> float:
    """Env-steps a second in the second half of a training, after the compiler."""
    lines = [json.loads(line) for line in (run / "metrics.jsonl").read_text().splitlines()]
    first, last = lines[len(lines) // 2], lines[-1]
    steps = last["env_steps"] - first["env_steps"]
    return float(steps / (last["seconds"] - first["seconds"]))


def score(run: Path) -> float:
    """The mean score of a run."""
    found: float = json.loads((run / "evaluation" / "summary.json").read_text())["score"]["mean"]
    return found


def row(training: Sequence[str], precision: str, runs: Path) -> list[str]:
    """A line of the table."""
    of = {
        name: [folder(training, name, seed, runs) for seed in SEEDS]
        for name in (precision, PRECISIONS[0])
    }
    rates, scores = ([f(run) for run in of[precision]] for f in (speed, score))
    cells = [", ".join([*reversed(training), precision]), f"{median(rates):,.0f}", ""]
    change = ""
    if precision != PRECISIONS[0]:
        ratios = [rate / speed(run) for rate, run in zip(rates, of[PRECISIONS[0]], strict=True)]
        cells[2] = f"{median(ratios):.2f} ({min(ratios):.2f} to {max(ratios):.2f})"
        change = f"{mean(scores) - mean(map(score, of[PRECISIONS[0]])):+.3f}"
    seeds = ", ".join(f"{one:.2f}" for one in scores)
    return [*cells, f"{mean(scores):.3f}", seeds, change]


def main() -> None:
    """Train, print, and fill the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=Path, default=Path("runs/precision"))
    given = parser.parse_args()
    rows = []
    for training in TRAININGS:
        for seed in SEEDS:
            train(training, seed, given.runs)
        rows += [row(training, precision, given.runs) for precision in PRECISIONS]
    head = (
        "`fast`",
        "env-steps/s",
        "to float32",
        "score, mean of 3 seeds",
        "seeds 0, 1, 2",
        "to float32",
    )
    publish("precision", f"{table(head, rows)}\n\n{machine('torch')}.")


if __name__ == "__main__":
    main()
