"""Robustness over seeds and methods: retention under faults, bounds, attention, redundancy.

`python benches/robustness.py RUNS` trains every missing run, measures them with
`innerattn robustness` (one core each, side by side), keeps the documents in RUNS, and fills the
tables of `docs/robustness.md`. A second call goes on where the first stopped.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import statistics
import subprocess
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

from page import ROBUSTNESS, machine, publish, table
from runs import Run, train_all

from innerattn.records.run_folder import read_info
from innerattn.stats.student import student_interval

METHODS = ("td-inner", "td-uniform", "ppo-inner", "ppo-uniform")
SCRIPTED = ("greedy", "hungarian", "oracle")
SEEN = ("motor_gain", "heading_bias", "unavailable")
MASKED = (("network.mask_unavailable", True),)
TEAMS = {"mixed-1-food": 1, "mixed": 2, "mixed-4-food": 4, "mixed-8": 4, "mixed-16": 8}

Document = dict[str, Any]


def measured(folders: Sequence[Path], name: str, *options: str) -> Document:
    """The document of `innerattn robustness` for these runs, kept beside them under this name.

    The name ends with what tells these runs from others of their names.
    """
    weights = "".join(str(read_info(folder).weights_sha256) for folder in folders)
    own = hashlib.sha256(weights.encode()).hexdigest()[:8]
    path = folders[0].parent / f"robustness-{name}-{own}.json"
    if not path.exists():
        command = ["innerattn", "robustness", *map(str, folders), *options, "--json", str(path)]
        done = subprocess.run(command, capture_output=True, text=True)
        if done.returncode:
            sys.exit(f"{path}: {done.stderr.strip()}")
        print(f"{path} done", file=sys.stderr)
    found: Document = json.loads(path.read_text())
    return found


def by_kind(document: Document, index: int, kind: str) -> Document:
    """Retention of the policy at this index under a kind of fault: mean, low and high."""
    found: Document = document["policies"][index]["by_kind"][kind]
    return found


def within_run(found: Document) -> str:
    """Mean, with half the 95 % interval over the worlds of one run."""
    return f"{found['mean']:.2f} ± {(found['high'] - found['low']) / 2:.2f}"


def over_seeds(values: Sequence[float]) -> str:
    """Mean, with half the 95 % interval over seeds where there are several."""
    if len(values) < 2:
        return f"{values[0]:.2f}"
    interval = student_interval(values)
    return f"{interval.mean:.2f} ± {interval.high - interval.mean:.2f}"


def of_runs(found: Sequence[Document]) -> str:
    """Over seeds; of a single run, over its worlds."""
    return within_run(found[0]) if len(found) < 2 else over_seeds([x["mean"] for x in found])


def kinds_table(head: Sequence[str], kinds: Sequence[str], cell: Callable[[str, int], str]) -> str:
    """A row for each kind of fault and one for all; `cell` gives the text of a kind and column."""
    rows = [
        [kind.replace("_", " "), *(cell(kind, c) for c in range(len(head) - 1))] for kind in kinds
    ]
    return table(head, rows)


def deployment(documents: Sequence[Document]) -> str:
    """Retention of each method, by kind, and inner minus uniform."""
    kinds = list(documents[0]["policies"][0]["by_kind"])
    names = (*METHODS, *SCRIPTED)

    def cell(kind: str, column: int) -> str:
        return of_runs([by_kind(one, column, kind) for one in documents])

    def difference(kind: str, column: int) -> str:
        inner, uniform = 2 * column, 2 * column + 1
        return over_seeds(
            [
                by_kind(one, inner, kind)["mean"] - by_kind(one, uniform, kind)["mean"]
                for one in documents
            ]
        )

    rescues = [
        of_runs([one["policies"][column]["rescues_per_episode"] for one in documents])
        for column in range(len(names))
    ]
    clean = table(["", *names], [["rescues", *rescues]])
    heads = ["inner - uniform", "td", "ppo"]
    return "\n\n".join(
        [
            kinds_table(["retention", *names], kinds, cell),
            clean,
            kinds_table(heads, kinds, difference),
        ]
    )


def recovery(documents: Sequence[Document]) -> str:
    """Retention soon after a fault in the middle of an episode, and later."""
    parts = ("early", "late", "late_minus_early")
    kinds = list(documents[0]["policies"][0]["after_onset"])
    cases = [(method, part) for method in (0, 1) for part in parts]

    def cell(kind: str, column: int) -> str:
        method, part = cases[column]
        return of_runs([one["policies"][method]["after_onset"][kind][part] for one in documents])

    words = {"early": "early", "late": "late", "late_minus_early": "difference"}
    head = ["retention", *(f"{METHODS[method]}, {words[part]}" for method, part in cases)]
    return kinds_table(head, kinds, cell)


def bounds(documents: Sequence[Document]) -> str:
    """Violations and tightness of the bounds, over all runs with learnt attention."""
    runs = [
        found
        for document in documents
        for found in document["bounds"].values()
        if found["attention"] == "inner"
    ]
    checks = sum(
        check["checks"]
        for run in runs
        for level in run["levels"]
        for check in level["checks"].values()
    )
    violations = sum(run["violations"] for run in runs)
    rows = []
    levels = zip(*(run["levels"] for run in runs), strict=True)
    for same in levels:
        one = same[0]
        if one["direction"] == "gradient_own":
            continue
        logit = [level["checks"]["logit"] for level in same]
        weight = [level["checks"]["weight"] for level in same]
        mean = statistics.mean
        rows.append(
            [
                f"{one['changed']}, {one['direction']}, {one['radius']:g}",
                f"{mean(x['median_tightness'] for x in logit):.3f}",
                f"{max(x['largest_tightness'] for x in logit):.2f}",
                f"{mean(x['median_change'] for x in weight):.3f}",
                f"{max(x['largest_change'] for x in weight):.2f}",
                f"{mean(level['teammates']['median'] for level in same):.3f}",
                f"{max(level['teammates']['largest'] for level in same):.2f}",
                _share([level["actor_flips"] for level in same]),
            ]
        )
    head = [
        "changed, direction, radius",
        *("logit / bound", "largest", "Δα", "largest", "ΔQ", "largest", "actor flips"),
    ]
    names = sum(len(document["bounds"]) for document in documents)
    text = (
        f"{violations} violations in {checks:,} checks of {len(runs)} critics with learnt "
        f"attention, of {names} runs.\n\n"
    )
    return text + table(head, rows)


def _share(values: Sequence[float | None]) -> str:
    known = [value for value in values if value is not None]
    return f"{statistics.mean(known):.0%}" if known else "-"


def attention(documents: Sequence[Document]) -> str:
    """What each kind of fault does to the weight on the robot that has it."""
    names = [name for name in METHODS if name.endswith("inner")]
    found: dict[str, list[Document]] = {name: [] for name in names}
    for document in documents:
        methods = {one["policy"]: one["method"] for one in document["policies"]}
        for run, one in document["attention"].items():
            found[methods[run]].append(one)
    kinds = [kind["kind"] for kind in found[names[0]][0]["kinds"]]

    def cell(kind: str, column: int) -> str:
        of_method = found[names[column // 3]]
        parts = [one["kinds"][kinds.index(kind)] for one in of_method]
        if column % 3 < 2:
            key = ("effect", "auc")[column % 3]
            return of_runs([part[key]["mean"] for part in parts])
        each = [robot["effect"]["mean"]["mean"] for part in parts for robot in part["robots"]]
        return f"{min(each):+.2f} to {max(each):+.2f}"

    head = ["worst fault", *(f"{n}, {x}" for n in names for x in ("effect", "AUC", "by robot"))]
    return kinds_table(head, kinds, cell)


def training(documents: Sequence[Document]) -> str:
    """Trained with faults, the same with unavailable robots masked, and without faults."""
    kinds = list(documents[0]["policies"][0]["by_kind"])
    ordered = [*SEEN, *(kind for kind in kinds if kind not in (*SEEN, "all")), "all"]
    head = ["retention", "trained with faults", "and masked", "without", "with - without", "mask"]

    def cell(kind: str, column: int) -> str:
        each = [[by_kind(one, index, kind) for index in range(3)] for one in documents]
        if column < 3:
            return of_runs([row[column] for row in each])
        one, other = (0, 2) if column == 3 else (1, 0)
        return over_seeds([row[one]["mean"] - row[other]["mean"] for row in each])

    def named(kind: str) -> str:
        return kind if kind == "all" else f"{kind} ({'seen' if kind in SEEN else 'unseen'})"

    rows = [
        [named(kind).replace("_", " "), *(cell(kind, c) for c in range(len(head) - 1))]
        for kind in ordered
    ]
    rescues = [
        [one["policies"][index]["rescues_per_episode"] for one in documents] for index in range(3)
    ]
    rows.append(["rescues without a fault", *(of_runs(x) for x in rescues), "", ""])
    return table(head, rows)


def redundancy(documents: dict[str, Document]) -> str:
    """Retention when one robot of a kind is lost from the start, against the team's size."""
    rows = []
    for preset, document in documents.items():
        for index, policy in enumerate(document["policies"]):
            if policy["policy"] == "greedy":
                continue
            name = policy["method"]
            lost = {
                cell["robot"]: cell["retention"]["mean"]
                for cell in document["policies"][index]["cells"]
                if cell["severity"] == 1.0 and cell["onset"] == "start"
            }

            def kept(kind: str, lost: dict[str, float] = lost) -> str:
                values = [value for robot, value in lost.items() if robot.startswith(kind)]
                return f"{statistics.mean(values):.2f}"

            rows.append(
                [
                    f"{preset} ({len(document['robots'])} robots, {TEAMS[preset]} food), {name}",
                    f"{policy['rescues_per_episode']['mean']:.2f}",
                    *(kept(kind) for kind in ("food", "navigation", "medical")),
                ]
            )
    return table(["team", "rescues", "food lost", "navigation lost", "medical lost"], rows)


def main() -> None:
    """Train and measure what is missing, and publish the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("runs", type=Path, help="folder of the runs")
    parser.add_argument("--seeds", nargs="+", type=int, default=[0, 1, 2])
    parser.add_argument("--workers", type=int, default=os.cpu_count())
    given = parser.parse_args()

    plain = {
        seed: [Run("mixed", method, "short", seed) for method in METHODS] for seed in given.seeds
    }
    with_faults = {
        seed: [
            Run("mixed-faults", "td-inner", "short", seed),
            Run("mixed-faults", "td-inner", "short", seed, options=MASKED),
            Run("mixed", "td-inner", "short", seed),
        ]
        for seed in given.seeds
    }
    teams = {preset: [Run(preset, "td-inner", "quick", 0)] for preset in TEAMS}
    documents = [*plain.values(), *with_faults.values(), *teams.values()]
    every_run = dict.fromkeys(run for runs in documents for run in runs)
    train_all(list(every_run), given.runs, given.workers)

    def measure(runs: Sequence[Run], name: str, *options: str) -> Future[Document]:
        return side_by_side.submit(measured, [given.runs / r.name for r in runs], name, *options)

    lost = ("--faults", "unavailable", "--episodes", "200")
    with ThreadPoolExecutor(given.workers) as side_by_side:
        plainly = [measure(runs, f"mixed-s{seed}") for seed, runs in plain.items()]
        faulty = [
            measure(runs, f"trained-with-faults-s{seed}") for seed, runs in with_faults.items()
        ]
        each = {preset: measure(runs, f"team-{preset}", *lost) for preset, runs in teams.items()}

    of_seed = [one.result() for one in plainly]
    publish("deployment", f"{machine('torch')}.\n\n{deployment(of_seed)}", ROBUSTNESS)
    publish("recovery", recovery(of_seed), ROBUSTNESS)
    publish("bounds", bounds(of_seed), ROBUSTNESS)
    publish("attention", attention(of_seed), ROBUSTNESS)
    publish("training", training([one.result() for one in faulty]), ROBUSTNESS)
    publish("redundancy", redundancy({k: one.result() for k, one in each.items()}), ROBUSTNESS)


if __name__ == "__main__":
    main()
