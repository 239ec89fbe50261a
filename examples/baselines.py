"""Trains teams with outside libraries and with ours, and writes docs/baselines.md.

Each learns for the same number of env-steps, in three situations, with three seeds. All are scored
in the same worlds. A result is written as soon as it is known, so that the command goes on where it
was stopped: what is known lies in `docs/records/baselines.jsonl`. Trainings may go side by side,
each on cores of its own.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from datetime import date
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
SITUATIONS, SEEDS, ENV_STEPS = ("single", "double", "mixed"), (0, 1, 2), 100_000
OURS = {
    # `fast` is made for 1.5 million env-steps; these are the worlds and epochs of the SB3 program.
    "ppo-inner": ("--train.num-envs", "64", "--ppo.epochs", "4"),
    "mappo": ("--train.num-envs", "64", "--ppo.epochs", "4"),
    "td-inner": (),
}
"""Our methods, and what they change in `--budget fast`."""
LIBRARIES = tuple(name for name in EXAMPLES if name != "optuna")  # a search is no algorithm
EMPTY = """# Baselines

Teams that outside libraries trained, beside ours. `python examples/baselines.py` trains and scores
all of them, and writes the table.

<!-- baselines: begin -->

<!-- baselines: end -->
"""
Row = dict[str, Any]
Key = tuple[str, str, int, int]


def ours(method: str, situation: str, seed: int, env_steps: int) -> Row:
    """Train with `innerattn train --budget fast` and `OURS`, and score as the examples do."""
    sys.path.append(str(Path(__file__).parent / "libraries"))
    import torch
    from scoring import report

    from innerattn.train import load_policy

    folder = ROOT / "runs" / f"baselines-{method}-{situation}-s{seed}-{env_steps}"
    command = [sys.executable, "-m", "innerattn", "train", "--preset", situation]
    command += ["--method", method, "--budget", "fast", "--seed", str(seed)]
    command += ["--train.env-steps", str(env_steps), "--run-dir", str(folder), *OURS[method]]
    if not (folder / "run.json").is_file():
        subprocess.run(command, check=True, cwd=ROOT, stdout=subprocess.DEVNULL)
    _, learner = load_policy(folder)
    seconds = json.loads((folder / "run.json").read_text("utf-8"))["seconds"]
    given = argparse.Namespace(situation=situation, seed=seed)
    return report(
        "innerattn",
        f"{method}, fast",
        given,
        env_steps,
        seconds,
        lambda obs: learner.act(torch.from_numpy(obs), greedy=True).numpy(),
    )


def script(name: str, situation: str) -> float:
    """Score of a script in the worlds that teams are scored in."""
    sys.path.append(str(Path(__file__).parent / "libraries"))
    from scoring import scripted

    from innerattn.config import Scenario

    scenario = Scenario.preset(situation)
    low, high = scripted(scenario, "random"), scripted(scenario, "hungarian")
    return (scripted(scenario, name) - low) / (high - low)


def trained(key: Key, places: Queue[set[int]]) -> Row:
    """Train one team with a library or with ours, on cores that nobody else here uses."""
    name, situation, seed, env_steps = key
    cores = places.get()
    try:
        if cores:
            os.sched_setaffinity(0, cores)  # of this thread, and of what it starts
        if name in OURS:
            return ours(name, situation, seed, env_steps)
        return run(name, env_steps, "--situation", situation, "--seed", str(seed))
    finally:
        places.put(cores)


def divided(at_once: int) -> Queue[set[int]]:
    """The usable cores in ``at_once`` equal shares; empty ones where cores cannot be chosen."""
    places: Queue[set[int]] = Queue()
    cores = sorted(os.sched_getaffinity(0)) if hasattr(os, "sched_setaffinity") else []
    share = len(cores) // at_once
    for place in range(at_once):
        places.put(set(cores[place * share : (place + 1) * share]))
    return places


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


def table(rows: dict[Key, Row], names: Iterable[str], env_steps: int) -> str:
    """A row for each name: mean score and range over seeds by situation, mean seconds."""
    head = ["trained with", *(f"score in `{one}`" for one in SITUATIONS), "training"]
    lines = [head, ["---", *["---:"] * (len(head) - 1)]]
    for name in names:
        cells, seconds = [], []
        for situation in SITUATIONS:
            found = [
                row
                for key, row in rows.items()
                if key[:2] == (name, situation) and key[3] == env_steps
            ]
            scores = [row["score"] for row in found]
            seconds += [row["train_seconds"] for row in found]
            spread = (
                f"{mean(scores):.2f} ({min(scores):.2f} to {max(scores):.2f})" if scores else ""
            )
            cells.append(spread or "not run")
        lines.append([f"`{name}`", *cells, f"{mean(seconds):.0f} s" if seconds else "not run"])
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def publish(rows: dict[Key, Row], names: Sequence[str], env_steps: int, at_once: int) -> None:
    """Write the table into the page, which is made where there is none."""
    if not PAGE.is_file():
        write_whole(PAGE, EMPTY.encode())
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    seeds = ", ".join(str(seed) for seed in sorted({key[2] for key in rows if key[3] == env_steps}))
    greedy = ", ".join(f"{script('greedy', one):.2f} in `{one}`" for one in SITUATIONS)
    note = (
        f"Mean and range over the seeds {seeds}; {env_steps:,} env-steps each; 500 episodes of "
        f"25 steps. A score of 0 is `random`, 1 is `hungarian`; `greedy` scores {greedy}. "
        f"{cores} cores, {at_once} training{'s' if at_once > 1 else ''} at a time, {date.today()}."
    )
    fill(PAGE, "baselines", f"{table(rows, names, env_steps)}\n\n{note}")


def main() -> None:
    """Train what is not known yet, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    choices = [*OURS, *LIBRARIES]
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"of {', '.join(choices)}")
    parser.add_argument("--env-steps", type=int, default=ENV_STEPS)
    parser.add_argument("--situations", nargs="+", choices=SITUATIONS, default=SITUATIONS)
    parser.add_argument("--seeds", nargs="+", type=int, default=SEEDS)
    parser.add_argument("--at-once", type=int, default=1, help="trainings side by side")
    given = parser.parse_args()
    if unknown := sorted(set(given.names) - set(choices)):
        parser.error(f"unknown {', '.join(unknown)}: known are {', '.join(choices)}")
    if not 1 <= given.at_once <= usable_cores():
        parser.error(f"--at-once {given.at_once}: must be from 1 to {usable_cores()}, the cores")
    names = given.names or choices
    for name in names:
        if name not in OURS:
            environment(EXAMPLES[name].program)  # one at a time: two may share a program
    rows, failed = known(), []
    missing = [
        key
        for seed in given.seeds
        for situation in given.situations
        for name in names
        if (key := (name, situation, seed, given.env_steps)) not in rows
    ]
    places = divided(given.at_once)
    with ThreadPoolExecutor(given.at_once) as pool:
        jobs = {pool.submit(trained, key, places): key for key in missing}
        for job in as_completed(jobs):
            key = jobs[job]
            name, situation, seed, _ = key
            try:
                rows[key] = job.result()
            except subprocess.CalledProcessError as error:
                print(f"{name}, {situation}, seed {seed}: {error}", file=sys.stderr, flush=True)
                failed.append(f"{name} in {situation}, seed {seed}")
            else:
                remember(rows)
    there = [name for name in choices if any(key[0] == name for key in rows)]
    publish(rows, there, given.env_steps, given.at_once)
    if failed:
        sys.exit(f"failed: {'; '.join(failed)}")


if __name__ == "__main__":
    main()
