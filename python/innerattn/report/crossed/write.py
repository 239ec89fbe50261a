"""The crossed design from finished runs, as files in a folder."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from innerattn.experiments.crossed.arms import CREDITS, CROSSED, Arm, Credit, arm_of
from innerattn.experiments.crossed.claims import idle_seeds
from innerattn.experiments.crossed.effects import MARGINS
from innerattn.experiments.crossed.outcome import IDLE, OUTCOMES
from innerattn.experiments.crossed.study import Situation, read_situations
from innerattn.experiments.run import FinishedRun, named_from
from innerattn.report.crossed.page import crossed_page, crossed_tables
from innerattn.report.crossed.tables import runs_csv
from innerattn.report.folder import ReportFolder
from innerattn.report.plots.arms import ArmDots, ArmPanel, draw_arms
from innerattn.report.plots.drawing import check_format
from innerattn.report.plots.seeds import SeedPanel, draw_seeds
from innerattn.stats.estimate import as_json

SCHEMA_VERSION = 2

FILES = (
    *(f"crossed.{kind}" for kind in ("csv", "json", "md", "pdf", "png")),
    *("crossed_seeds.pdf", "crossed_seeds.png", "crossed_tables.md"),
)
"""What `write` writes."""

_DRAWN = {
    "imbalance": ("imbalance", (MARGINS["imbalance"],), (0.0, 0.5)),
    "least_share": ("smaller share", (IDLE,), (0.0, 0.5)),
    "score": ("score", (), None),
    "entropy_share": ("entropy / ln(N − 1)", (1.0,), (0.0, 1.0)),
}
"""Label, marks and limits of what is drawn of all arms."""


def write(
    runs: Sequence[FinishedRun], out: Path, budget: str, left_out: Sequence[str] = ()
) -> list[Situation]:
    """Write `FILES` into ``out``.

    The same runs give the same bytes.

    Args:
        runs: finished runs of the design, at least one; they are read only.
        out: folder of the study; the runs' folders are named from there.
        budget: name of the budget they were trained with.
        left_out: what is said of runs that were planned and are not among ``runs``.

    Returns:
        What the report says, by situation.

    Raises:
        RunError: records cannot be read, a run's team has not two food robots, or matplotlib is not
            installed.
        OSError: a file cannot be written; each is written whole or not at all.
    """
    check_format(out / "crossed.png")
    situations = read_situations(runs)
    folder = ReportFolder(out, budget)
    document = crossed_document(situations, out)
    folder.json("crossed.json", {"schema_version": SCHEMA_VERSION, "budget": budget, **document})
    folder.csv("crossed.csv", runs_csv(document["situations"]))
    folder.markdown("crossed.md", crossed_page(situations, budget, left_out))
    folder.markdown("crossed_tables.md", crossed_tables(situations))
    folder.draw("crossed", draw_arms([arm_panels(situation) for situation in situations]))
    folder.draw("crossed_seeds", draw_seeds(seed_panels(situations)))
    return situations


def crossed_document(situations: Sequence[Situation], out: Path) -> dict[str, Any]:
    """What the design shows, as JSON values."""
    return {"outcomes": OUTCOMES, "situations": [_situation(one, out) for one in situations]}


def _situation(situation: Situation, out: Path) -> dict[str, Any]:
    outcomes = situation.outcomes
    return {
        "situation": situation.name,
        "answers": as_json(situation.answers),
        "seeds": as_json(situation.seeds),
        "arms": [
            {
                **_arm(arm),
                "runs": len(outcomes[arm]),
                "idle": idle_seeds(outcomes, [arm])[0],
                "mean": as_json(means),
            }
            for arm, means in situation.means.items()
        ],
        "effects": as_json(situation.effects),
        "runs": [
            {
                **_arm(arm_of(run.case)),
                "seed": run.seed,
                "folder": named_from(run.folder, out),
                **asdict(outcomes[arm_of(run.case)][run.seed]),
                "config_sha256": run.config_sha256,
                "weights_sha256": run.weights_sha256,
            }
            for run in situation.runs
        ],
    }


def _arm(arm: Arm) -> dict[str, Any]:
    return {**asdict(arm), "method": arm.method}


def arm_panels(situation: Situation) -> list[ArmPanel]:
    """A panel for each result, with all arms."""
    panels = []
    for name, (label, marks, limits) in _DRAWN.items():
        dots = []
        for arm, by_seed in situation.outcomes.items():
            values = (getattr(outcome, name) for outcome in by_seed.values())
            known = tuple(value for value in values if value is not None)
            mean = situation.means[arm][name]
            dots.append(ArmDots(str(arm), arm.penalty is not None, known, mean))
        panels.append(ArmPanel(situation.name, label, tuple(dots), marks, limits))
    return panels


def seed_panels(situations: Sequence[Situation]) -> list[list[SeedPanel]]:
    """A row for each credit, the team's first, a panel for each situation."""
    return [
        [_seed_panel(situation, credit) for situation in situations] for credit in reversed(CREDITS)
    ]


def _seed_panel(situation: Situation, credit: Credit) -> SeedPanel:
    dots = {
        "uniform" if arm.penalty is None else f"inner, λ = {arm.penalty:g}": {
            seed: outcome.first_share
            for seed, outcome in situation.outcomes[arm].items()
            if outcome.first_share is not None
        }
        for arm in CROSSED
        if arm.credit == credit
    }
    return SeedPanel(f"{situation.name}, {credit} credit", dots)
