"""What the runs of a study cost on this machine, and what more cores would make of it.

`python benches/study_cost.py` works through a study of 24 runs of some 10 s with a worker for each
core, and prints a table: time, memory and disk of a run, the share of the time in which workers
compute, and what a worker does besides training and evaluation. The last lines are a model: runs
that do not depend on each other, each on a core, and files that a server takes at a given rate.
"""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
import time
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory

from page import machine, publish, table

from innerattn.cores import usable_cores
from innerattn.studies.folder import StudyFolder, open_study

STUDIES = Path(__file__).parents[1] / "docs" / "studies.md"
STUDY = """
[grid]
methods = ["ppo-inner", "mappo"]
budgets = ["fast"]
seeds = "0..11"
[[variants]]
name = "short"
train.env_steps = 150_000
train.compile = "off"
evaluate.score_episodes = 500
"""
CORES = (10, 100, 1_000)
RUNS = 1_000


def bytes_in(folder: Path) -> int:
    """Size of all files in a folder."""
    return sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())


def run_seconds(study: StudyFolder) -> list[float]:
    """Time of each run from its claim to the end of its evaluation [s]."""
    return [
        (study.runs / run.key / "evaluation/summary.json").stat().st_mtime
        - (study.path / "claims" / f"{run.key}.1").stat().st_mtime
        for run in study.planned
    ]


def measure() -> None:
    """Work through the study, and print the tables."""
    workers = usable_cores()
    with TemporaryDirectory() as place:
        file, out = Path(place) / "study.toml", Path(place) / "out"
        file.write_text(STUDY)
        words = ["study", "run", str(file), "--out", str(out), "--workers", str(workers), "-q"]
        begun = time.monotonic()
        subprocess.run([sys.executable, "-m", "innerattn", *words], check=True)
        wall = time.monotonic() - begun
        used = resource.getrusage(resource.RUSAGE_CHILDREN)
        study = open_study(out)
        seconds = run_seconds(study)
        trained = [
            json.loads((study.runs / run.key / "run.json").read_text())["seconds"]
            for run in study.planned
        ]
        files = [
            sum(len(names) for *_, names in os.walk(study.runs / run.key)) for run in study.planned
        ]
        size = [bytes_in(study.runs / run.key) for run in study.planned]
    runs = len(seconds)
    besides = (workers * wall - sum(seconds)) / runs
    rows = [
        ["runs, workers", f"{runs}, {workers}"],
        ["whole study [s]", f"{wall:.0f}"],
        ["a run, from its claim to the end of its evaluation [s]", f"{median(seconds):.1f}"],
        ["of this, training [s]", f"{median(trained):.1f}"],
        ["besides, for each run: start of workers, claims, report [s]", f"{besides:.1f}"],
        [
            "processor time of all cores",
            f"{100.0 * (used.ru_utime + used.ru_stime) / wall / workers:.0f} %",
        ],
        ["most memory of a process [MB]", f"{used.ru_maxrss / 1024.0:.0f}"],
        ["disk of a finished run [MB]", f"{median(size) / 1e6:.1f}"],
        ["files of a finished run", f"{median(files):.0f}"],
    ]
    each = median(seconds) + besides
    model = [
        [
            f"{cores:,}",
            f"{RUNS / cores * each / 60.0:.1f}",
            f"{cores * median(size) / each / 1e6:.1f}",
            f"{cores * median(files) / each:.0f}",
        ]
        for cores in CORES
    ]
    parts = [
        f"{machine('torch')}.",
        table(["", "measured"], rows),
        f"The model for {RUNS:,} such runs, on cores as fast, where the file system keeps up:",
        table(["cores", "minutes", "MB/s written", "files/s"], model),
    ]
    publish("cost", "\n\n".join(parts), STUDIES)


if __name__ == "__main__":
    measure()
