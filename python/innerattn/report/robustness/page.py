"""The page on what faults cost, from finished runs and the documents of their study."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from innerattn.experiments.robustness.design import TEAM_BUDGET
from innerattn.experiments.robustness.results import Deployment, Robustness, read_robustness
from innerattn.experiments.run import FinishedRun
from innerattn.report.folder import ReportFolder, left_out_list, listed_runs
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
from innerattn.stats.estimate import as_json
from innerattn.stats.text import format_seeds

SCHEMA_VERSION = 1

FILES = ("robustness.json", "robustness.md")
"""What `write` writes."""

RETENTION = "Retention by kind of fault"
RECOVERY = "Early and late retention"
BOUNDS = "The bound on attention"
ATTENTION = "Where attention goes"
"""Headings of the sections on one situation, which its name follows."""
TRAINING = "Training with faults"
TEAMS = "Redundancy"
"""Headings of the other sections."""


TERMS = """\
- *Retention* is rescues with a fault divided by rescues without it, in the same worlds, from the
  onset of the fault on: a mean over robots, onsets and severities from 0 to 1.
- *Early* and *late* are the first and the second half of the time after a fault that begins in the
  middle of an episode. `oracle` knows of the fault, so its retention is the ceiling of a script.
- *With a fault*, rescues are per episode with a fault from the start, a mean over kinds, severities
  from 0 to 1 and robots.
- *Effect* is that of the worst fault on the attention weight that the failing robot receives, and
  *AUC* says how well this weight tells a faulty robot from a healthy one; means over robots. *By
  robot* is the least and the largest effect on any robot of any run.
- *Masked* teams keep unavailable robots out of the critic's attention; *mask* is what that adds.
- *Lost* is one robot of the kind, from start to end; a mean over the robots of that kind.
- ± is half the 95 % interval over seeds (Student's t); of a single seed, over its worlds.
"""
"""What the words of the tables mean, in Markdown."""


def write(
    runs: Sequence[FinishedRun], out: Path, budget: str, left_out: Sequence[str]
) -> Robustness:
    """Write `FILES` into ``out``; the same runs and documents give the same bytes.

    Args:
        runs: finished runs of the study, at least one; they are read only.
        out: folder of the study, which holds the documents.
        budget: name of the budget the runs were trained with.
        left_out: what is said of runs and measurements that are missing.

    Returns:
        What the report says.

    Raises:
        RunError: a document is damaged.
        OSError: a file cannot be written; each is written whole or not at all.
    """
    found = read_robustness(runs, out)
    folder = ReportFolder(out, budget)
    document = {"schema_version": SCHEMA_VERSION, "budget": budget, **as_json(found)}
    folder.json("robustness.json", {**document, "runs": listed_runs(runs, out)})
    folder.markdown("robustness.md", robustness_page(found, budget, left_out))
    return found


def robustness_page(found: Robustness, budget: str, left_out: Sequence[str]) -> str:
    """The page.

    Args:
        found: what faults cost.
        budget: name of the budget the runs were trained with.
        left_out: what is said of runs and measurements that were planned and are not in it.
    """
    parts = ["# What faults cost\n", *left_out_list(left_out)]
    if found.deployments:
        parts.append(
            f"Budget `{budget}`, training seeds {format_seeds(found.seeds)}; each fault is tried "
            f"in {found.episodes:,} worlds of each seed. Teams by their size are single runs of "
            f"budget `{TEAM_BUDGET}`.\n"
        )
    parts.append(TERMS)
    for one in found.deployments:
        parts += _deployment(one)
    if found.training is not None:
        parts += [f"## {TRAINING}\n", markdown(training_table(found.training))]
    if found.teams:
        parts += [f"## {TEAMS}\n", markdown(teams_table(found.teams))]
    return "\n".join(parts)


def _deployment(found: Deployment) -> list[str]:
    where, bounds = found.situation, found.bounds
    tables = [markdown(retention_table(found)), markdown(rescues_table(found))]
    tables += [markdown(differences_table(found))] if found.differences else []
    parts = [f"## {RETENTION}: {where}\n", *tables]
    parts += [f"## {RECOVERY}: {where}\n", markdown(recovery_table(found))]
    if bounds is not None:
        parts += [
            f"## {BOUNDS}: {where}\n",
            f"{bounds.violations} violations in {bounds.checks:,} checks of {bounds.critics} "
            f"critics with inner attention, of {bounds.runs} runs. Numbers are means over critics "
            "of medians, and largest values.\n",
            markdown(bounds_table(bounds)),
        ]
    if found.attention:
        parts += [f"## {ATTENTION}: {where}\n", markdown(attention_table(found))]
    return parts
