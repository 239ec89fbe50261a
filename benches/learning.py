"""What methods learn: trains every missing run, one core each, and tabulates scores over seeds.

`python benches/learning.py RUNS` fills a place in `docs/learning.md` for each budget and draws the
learning curves that are shown there, and others when given `--warm-start hungarian` or
`--encoder entities`. A second call goes on where the first stopped.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
from itertools import product
from pathlib import Path
from typing import Any

from learning_figure import draw_curves
from page import LEARNING, publish, require, table
from runs import Run, train_all

from innerattn.experiments.paper.claims import LEAST_PAIRS
from innerattn.experiments.paper.pairs import MARGINS
from innerattn.report.plots.drawing import write_figure
from innerattn.stats.comparison import contrast
from innerattn.stats.student import student_interval
from innerattn.stats.text import format_estimate

PRESETS = ("mixed", "double", "single")
METHODS = {"quick": ["td-inner"], "short": ["td-inner", "td-uniform", "ppo-inner", "ppo-uniform"]}
SEEDS = {"quick": [0, 1, 2], "short": [0, 1, 2, 3, 4]}
RunStatus = dict[tuple[str, str], list[dict[str, Any]]]
"""Summaries of the runs of each method and preset, one per seed."""


def _summary(run: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((run / "evaluation" / "summary.json").read_text())
    return found


def _score(run: dict[str, Any]) -> float:
    return float(run["score"]["mean"])


def _long_score(run: dict[str, Any]) -> float:
    return float(run["long"]["score"]["mean"])


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
        over_seeds([_score(one) for one in found]),
        over_seeds([_long_score(one) for one in found]),
    ]


def attention_table(found: RunStatus) -> str:
    """Scores with learnt attention minus those with uniform weights, seed by seed."""
    head = ["learnt - uniform attention"]
    for length in (25, 100):
        head += [f"score, {length} steps [95 %]", f"alike within {MARGINS['score']}?"]
    rows = []
    for (method, preset), learnt in found.items():
        uniform = found.get((method.replace("-inner", "-uniform"), preset))
        if not method.endswith("-inner") or uniform is None or len(learnt) < LEAST_PAIRS:
            continue
        cells = []
        for score in (_score, _long_score):
            both = [(score(one), score(other)) for one, other in zip(learnt, uniform, strict=True)]
            compared = contrast(both, (1.0, -1.0), MARGINS["score"])
            if compared is None:
                cells += ["–", "–"]
                continue
            alike = "yes" if compared.equivalent else "not shown"
            cells += [format_estimate(compared.difference), alike]
        rows.append([f"{method.removesuffix('-inner')}, {preset}", *cells])
    return table(head, rows) if rows else ""


def main() -> None:
    """Train what is missing and publish the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("runs", type=Path, help="folder of the runs")
    parser.add_argument("--warm-start", default="none", choices=["none", "hungarian", "greedy"])
    parser.add_argument("--encoder", default="flat", choices=["flat", "entities"])
    parser.add_argument("--presets", nargs="+", default=list(PRESETS), choices=PRESETS)
    parser.add_argument("--budgets", nargs="+", default=list(METHODS), choices=list(METHODS))
    parser.add_argument("--methods", nargs="+", help="others than a budget has by default")
    parser.add_argument("--seeds", nargs="+", type=int, help="others than a budget has by default")
    parser.add_argument("--workers", type=int, default=os.cpu_count())
    given = parser.parse_args()
    options = () if given.encoder == "flat" else (("network.encoder", given.encoder),)
    start = "learning" if given.warm_start == "none" else "warm_start"
    end = "" if given.encoder == "flat" else f"_{given.encoder}"
    places = {budget: f"{start}_{budget}{end}" for budget in given.budgets}
    for place in places.values():
        require(place, LEARNING)  # before hours of training, not after
    for budget, place in places.items():
        cases = list(product(given.methods or METHODS[budget], given.presets))
        seeds = given.seeds or SEEDS[budget]
        wanted = [
            Run(preset, method, budget, seed, given.warm_start, options)
            for method, preset in cases
            for seed in seeds
        ]
        trained = iter(train_all(wanted, given.runs, given.workers))
        folders = {case: [next(trained) for _ in seeds] for case in cases}
        found: RunStatus = {case: [_summary(run) for run in runs] for case, runs in folders.items()}
        rows = [[f"{method}, {preset}", *row(found[method, preset])] for method, preset in cases]
        listed = ", ".join(map(str, seeds))
        head = [f"{budget}, seed{'s' if len(seeds) > 1 else ''} {listed}", "rescues, 25 steps"]
        head += ["score, 25 steps", "score, 100 steps"]
        tables = [table(head, rows), attention_table(found)]
        publish(place, "\n\n".join(filter(None, tables)), LEARNING)
        picture = LEARNING.parent / "images" / f"{place}.png"
        if f"(images/{picture.name})" in LEARNING.read_text():
            write_figure(picture, draw_curves(folders))


if __name__ == "__main__":
    main()
