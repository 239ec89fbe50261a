"""The page on what faults cost, as Markdown."""

from __future__ import annotations

from collections.abc import Sequence

from innerattn.experiments.robustness.results import Deployment, Robustness
from innerattn.report.robustness.tables import (
    attention_table,
    bounds_table,
    differences_table,
    recovery_table,
    rescues_table,
    retention_table,
    teams_table,
    training_table,
)
from innerattn.report.table import markdown
from innerattn.stats.text import format_seeds

RETENTION = "Retention by kind of fault"
RECOVERY = "Early and late retention"
BOUNDS = "The bound on attention"
ATTENTION = "Where attention goes"
"""Headings of the sections on one situation, which its name follows."""
TRAINING = "Training with faults"
TEAMS = "Redundancy"
"""Headings of the other sections."""


def robustness_page(found: Robustness, budget: str, left_out: Sequence[str]) -> str:
    """The page.

    Args:
        found: what faults cost.
        budget: name of the budget the runs were trained with.
        left_out: what is said of runs and measurements that were planned and are not in it.
    """
    parts = ["# What faults cost\n"]
    if left_out:
        parts += ["**Left out of all results:**\n", *(f"- {one}" for one in left_out), ""]
    if found.deployments:
        parts.append(
            f"Budget `{budget}`, training seeds {format_seeds(found.seeds)}; each fault is tried "
            f"in {found.episodes:,} worlds of each seed. Retention is rescues with a fault divided "
            "by rescues without it. ± is half the 95 % interval over seeds (Student's t); of a "
            "single seed, over its worlds.\n"
        )
    for one in found.deployments:
        parts += _deployment(one)
    if found.training is not None:
        parts += [
            f"## {TRAINING}\n",
            "Teams of td-inner in mixed. *Mask*: unavailable robots are kept out of the critic's "
            "attention; its column is the second minus the first.\n",
            markdown(training_table(found.training)),
        ]
    if found.teams:
        parts += [
            f"## {TEAMS}\n",
            "Retention when one robot of a kind is unavailable from start to end, a mean over "
            "the robots of that kind. One run of budget `quick` for each team.\n",
            markdown(teams_table(found.teams)),
        ]
    return "\n".join(parts)


def _deployment(found: Deployment) -> list[str]:
    parts = [
        f"## {RETENTION}: {found.situation}\n",
        markdown(retention_table(found)),
        "Rescues per episode; with a fault from the start, a mean over kinds, severities and "
        "robots:\n",
        markdown(rescues_table(found)),
    ]
    if found.differences:
        parts += [
            "Retention with inner minus that with uniform attention, one difference per seed:\n",
            markdown(differences_table(found)),
        ]
    parts += [
        f"## {RECOVERY}: {found.situation}\n",
        "In the first and in the second half of the time after a fault that begins in the middle "
        "of an episode. `oracle` knows of the fault: its retention is the ceiling of a script.\n",
        markdown(recovery_table(found)),
    ]
    bounds = found.bounds
    if bounds is not None:
        parts += [
            f"## {BOUNDS}: {found.situation}\n",
            f"{bounds.violations} violations in {bounds.checks:,} checks of {bounds.critics} "
            f"critics with inner attention, of {bounds.runs} runs. Columns are means over runs of "
            "medians, and largest values over runs.\n",
            markdown(bounds_table(bounds)),
        ]
    if found.attention:
        parts += [
            f"## {ATTENTION}: {found.situation}\n",
            "The effect of a fault on the weight that the failing robot receives, a mean over "
            "robots; *by robot* is the least and the largest effect on any robot of any run.\n",
            markdown(attention_table(found)),
        ]
    return parts
