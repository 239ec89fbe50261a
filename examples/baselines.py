"""Trains teams with outside libraries and with ours, and fills the table of docs/baselines.md.

Each learns for the same number of env-steps, in three situations, with three seeds, on one core.
All are scored in the same worlds. A result is written as soon as it is known, so that the command
goes on where it was stopped: what is known lies in `docs/records/baselines.jsonl`. Trainings may go
side by side, each on a core of its own.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from datetime import date
from functools import cache
from pathlib import Path
from queue import Queue
from statistics import mean
from typing import Any

from run_all import EXAMPLES, environment, run

from innerattn.config.files import write_whole
from innerattn.cores import usable_cores
from innerattn.report.marks import fill

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "baselines.md"
KNOWN = ROOT / "docs" / "records" / "baselines.jsonl"
SITUATIONS, SEEDS = ("single", "double", "mixed"), (0, 1, 2)
ENV_STEPS = 64_000
"""A multiple of every program's rollout, so that all train exactly as long; enough for most of them
to come near the scripts, and so few that the whole table takes about 75 minutes of one core."""
NAMES = tuple(name for name in EXAMPLES if name != "optuna")  # a search is no algorithm
Row = dict[str, Any]
Key = tuple[str, str, int, int]


@cache
def script(name: str, situation: str) -> float:
    """Score of a script in the worlds that teams are scored in."""
    sys.path.append(str(Path(__file__).parent / "libraries"))
    from scoring import scripted

    from innerattn.config import Scenario

    scenario = Scenario.preset(situation)
    low, high = scripted(scenario, "random"), scripted(scenario, "hungarian")
    return (scripted(scenario, name) - low) / (high - low)


def trained(key: Key, cores: Queue[int | None]) -> Row:
    """Train one team on a core that nobody else here uses."""
    name, situation, seed, env_steps = key
    core = cores.get()
    try:
        if core is not None:
            os.sched_setaffinity(0, {core})  # of this thread, and of what it starts
        return run(name, env_steps, "--situation", situation, "--seed", str(seed))
    finally:
        cores.put(core)


def chosen_cores(count: int) -> Queue[int | None]:
    """That many usable cores; none where they cannot be chosen."""
    here = sorted(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else [None] * count
    cores: Queue[int | None] = Queue()
    for core in here[-count:]:
        cores.put(core)
    return cores


def known() -> dict[Key, Row]:
    """What was trained before, by name, situation, seed and env-steps."""
    if not KNOWN.is_file():
        return {}
    rows = map(json.loads, KNOWN.read_text("utf-8").splitlines())
    return {tuple(row["key"]): row["result"] for row in rows}


def remember(rows: dict[Key, Row]) -> None:
    """Write what is known, as a whole."""
    KNOWN.parent.mkdir(exist_ok=True)
    lines = [json.dumps({"key": key, "result": row}) for key, row in rows.items()]
    write_whole(KNOWN, "".join(f"{line}\n" for line in lines).encode())


def scores(rows: dict[Key, Row], name: str, situation: str, env_steps: int) -> list[float]:
    """Scores of all seeds that are known."""
    return [
        row["score"]
        for key, row in rows.items()
        if key[:2] == (name, situation) and key[3] == env_steps
    ]


def cell(found: Sequence[float]) -> str:
    """Mean and range over seeds, and how many they are if some are missing."""
    if not found:
        return "not run"
    told = [f"{min(found):.2f} to {max(found):.2f}"] if len(found) > 1 else []
    told += [] if len(found) == len(SEEDS) else [f"{len(found)} of {len(SEEDS)} seeds"]
    return f"{mean(found):.2f} ({', '.join(told)})"


def overall(rows: dict[Key, Row], name: str, env_steps: int) -> float:
    """Mean over the situations that are known; -1 where none is."""
    found = [scores(rows, name, one, env_steps) for one in SITUATIONS]
    return mean(mean(one) for one in found if one) if any(found) else -1.0


def summary(rows: dict[Key, Row], env_steps: int) -> str:
    """The best of those that are known in every situation, and the script beside them."""
    whole = [
        name for name in NAMES if all(scores(rows, name, one, env_steps) for one in SITUATIONS)
    ]
    means = {name: overall(rows, name, env_steps) for name in whole}
    best = sorted(whole, key=lambda name: means[name], reverse=True)[:3]
    greedy = mean(script("greedy", one) for one in SITUATIONS)
    if len(best) < 3:
        return f"Over the three situations the script `greedy` scores {greedy:.2f}."
    told = [f"`{name}` with {means[name]:.2f}" for name in best]
    return (
        f"Over the three situations the best are {told[0]}, {told[1]} and {told[2]}; the script "
        f"`greedy` scores {greedy:.2f}."
    )


def table(rows: dict[Key, Row], env_steps: int) -> str:
    """A row for each name: mean score by situation, mean seconds of a core.

    The best come first, those before all others that are known in every situation.
    """

    def place(name: str) -> tuple[bool, float]:
        missing = any(not scores(rows, name, one, env_steps) for one in SITUATIONS)
        return missing, -overall(rows, name, env_steps)

    head = ["trained with", *(f"`{one}`" for one in SITUATIONS), "seconds"]
    lines = [head, ["---", *["---:"] * (len(head) - 1)]]
    for name in sorted(NAMES, key=place):
        cells = [cell(scores(rows, name, one, env_steps)) for one in SITUATIONS]
        ours = [row for key, row in rows.items() if key[0] == name and key[3] == env_steps]
        cells.append(f"{mean(row['train_cpu_seconds'] for row in ours):.0f}" if ours else "not run")
        lines.append([f"`{name}`", *cells])
    greedy = [f"{script('greedy', one):.2f}" for one in SITUATIONS]
    lines.append(["the script `greedy`", *greedy, ""])
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def publish(rows: dict[Key, Row], env_steps: int, at_once: int) -> None:
    """Write what was found into the page."""
    seeds = ", ".join(str(seed) for seed in sorted({key[2] for key in rows if key[3] == env_steps}))
    note = (
        f"Score: mean and range over seeds ({seeds}). {env_steps:,} env-steps each, one core "
        f"each, {at_once} training{'s' if at_once > 1 else ''} at a time, {date.today()}."
    )
    parts = (summary(rows, env_steps), table(rows, env_steps), note)
    fill(PAGE, "baselines", "\n\n".join(parts))


def main() -> None:
    """Train what is not known yet, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"of {', '.join(NAMES)}")
    parser.add_argument("--env-steps", type=int, default=ENV_STEPS)
    parser.add_argument("--situations", nargs="+", choices=SITUATIONS, default=SITUATIONS)
    parser.add_argument("--seeds", nargs="+", type=int, default=SEEDS)
    parser.add_argument("--at-once", type=int, default=1, help="trainings side by side")
    given = parser.parse_args()
    if unknown := sorted(set(given.names) - set(NAMES)):
        parser.error(f"unknown {', '.join(unknown)}: known are {', '.join(NAMES)}")
    if not 1 <= given.at_once <= usable_cores():
        parser.error(f"--at-once {given.at_once}: must be from 1 to {usable_cores()}, the cores")
    names = given.names or NAMES
    for name in names:
        environment(EXAMPLES[name].program)  # one at a time: two may share a program
    rows, failed = known(), []
    missing = [
        key
        for seed in given.seeds
        for situation in given.situations
        for name in names
        if (key := (name, situation, seed, given.env_steps)) not in rows
    ]
    cores = chosen_cores(given.at_once)
    publish(rows, given.env_steps, given.at_once)
    with ThreadPoolExecutor(given.at_once) as pool:
        jobs = {pool.submit(trained, key, cores): key for key in missing}
        for job in as_completed(jobs):
            key = jobs[job]
            name, situation, seed, _ = key
            try:
                rows[key] = job.result()
            except (subprocess.CalledProcessError, json.JSONDecodeError) as error:
                print(f"{name}, {situation}, seed {seed}: {error}", file=sys.stderr, flush=True)
                failed.append(f"{name} in {situation}, seed {seed}")
            else:
                remember(rows)
                publish(rows, given.env_steps, given.at_once)
    if failed:
        sys.exit(f"failed: {'; '.join(failed)}")


if __name__ == "__main__":
    main()
