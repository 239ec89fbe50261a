"""How short the planner's schedules of published instances are, and how long it takes.

`python benches/planner_quality.py` fills a table in `docs/instances.md`: means over the 30
instances of `ral` and over seeds, on one core, beside the plain planners and what was published.
"""

from __future__ import annotations

import os
from pathlib import Path
from statistics import mean

from page import machine, publish, table

from innerattn.config.instances import Instance, read_instances
from innerattn.evaluate.instances import InstanceResults, solve_instances

PAGE = Path(__file__).parents[1] / "docs" / "instances.md"
SEEDS = range(3)
LIMITS_MS = (10, 50, 1000)
GUIDED_MS = (100, 1000)
HEAD = ["schedule", "mean makespan", "ratio", "shorter than published", "seconds each"]


def main() -> None:
    """Measures and publishes."""
    load = os.getloadavg()[0]
    instances = read_instances("ral")
    published = mean(makespan(instance) for instance in instances)
    rows = [["published, after 600 s", f"{published:.2f}", "1.000", "–", "600"]]
    rows += [row("random", "random", instances, 1), row("greedy", "greedy", instances, 1)]
    for limit in LIMITS_MS:
        rows.append(row(f"planner, {limit:,} ms", "planner", instances, limit))
    rows.append(row("learnt", "learnt", instances, 1))
    rows += [row(f"guided, {limit:,} ms", "guided", instances, limit) for limit in GUIDED_MS]
    seeds = f"Seeds {SEEDS[0]} to {SEEDS[-1]}; the load was {load:.1f} before the first run."
    publish("planner_quality", f"{table(HEAD, rows)}\n\n{machine()}. {seeds}", PAGE)


def makespan(instance: Instance) -> float:
    """The published makespan of an instance."""
    assert instance.makespan_milp_600s is not None
    return instance.makespan_milp_600s


def row(name: str, planner: str, instances: tuple[Instance, ...], limit_ms: int) -> list[str]:
    """A row of the table: means over seeds."""
    found = [solve_instances(planner, instances, limit_ms, seed) for seed in SEEDS]
    ratios = [one.ratio for one in found if one.ratio is not None]
    return [
        name,
        f"{mean(one.mean_makespan for one in found):.2f}",
        f"{mean(ratios):.3f}",
        f"{mean(map(shorter, found)):.1f}",
        f"{mean(one.mean_seconds for one in found):.4f}",
    ]


def shorter(results: InstanceResults) -> int:
    """How many schedules are shorter than the published ones."""
    return sum(one.makespan < makespan(one.instance) for one in results.solved)


if __name__ == "__main__":
    main()
