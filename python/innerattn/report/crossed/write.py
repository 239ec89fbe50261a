"""The crossed design from finished runs, as files in a folder."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from innerattn.config.files import write_whole
from innerattn.experiments.crossed.claims import idle_seeds
from innerattn.experiments.crossed.outcome import OUTCOMES
from innerattn.experiments.crossed.study import Situation, read_situations
from innerattn.experiments.run import FinishedRun, named_from
from innerattn.experiments.smoke import smoke_note
from innerattn.report.crossed.figures import arm_panels, seed_panels
from innerattn.report.crossed.page import crossed_page, crossed_tables
from innerattn.report.crossed.tables import runs_csv
from innerattn.report.plots.arms import draw_arms
from innerattn.report.plots.drawing import check_format, write_figure
from innerattn.report.plots.seeds import draw_seeds
from innerattn.report.smoke import mark_figure, noted_csv, noted_markdown
from innerattn.stats.estimate import as_json

SCHEMA_VERSION = 2

FILES = (
    *(f"crossed.{kind}" for kind in ("csv", "json", "md", "pdf", "png")),
    *("crossed_seeds.pdf", "crossed_seeds.png", "crossed_tables.md"),
)
"""What `write_crossed` writes."""


def write_crossed(
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
    document = json.dumps(_document(situations, out, budget), indent=1, allow_nan=False)
    write_whole(out / "crossed.json", f"{document}\n".encode())
    named = {str(run.folder): named_from(run.folder, out) for run in runs}
    lines = noted_csv(runs_csv(situations, named), budget)
    write_whole(out / "crossed.csv", lines.encode())
    for name, text in (
        ("crossed.md", crossed_page(situations, budget, left_out)),
        ("crossed_tables.md", crossed_tables(situations)),
    ):
        write_whole(out / name, noted_markdown(text, budget).encode())
    for name, figure in (
        ("crossed", draw_arms([arm_panels(situation) for situation in situations])),
        (
            "crossed_seeds",
            draw_seeds(seed_panels(situations), "share of the first food robot", 0.5),
        ),
    ):
        mark_figure(figure, budget)
        for suffix in (".pdf", ".png"):
            write_figure(out / f"{name}{suffix}", figure)
    return situations


def _document(situations: Sequence[Situation], out: Path, budget: str) -> dict[str, Any]:
    return {
        "schema_version": SCHEMA_VERSION,
        "note": smoke_note(budget),
        "budget": budget,
        "outcomes": OUTCOMES,
        "situations": [_situation(situation, out) for situation in situations],
    }


def _situation(situation: Situation, out: Path) -> dict[str, Any]:
    outcomes = situation.outcomes()
    return {
        "situation": situation.name,
        "answers": [asdict(answer) for answer in situation.answers],
        "seeds": as_json(situation.seeds),
        "arms": [
            {
                **asdict(arm),
                "method": arm.method,
                "runs": len(outcomes[arm]),
                "idle": idle_seeds(outcomes, [arm])[0],
                "mean": as_json(means),
            }
            for arm, means in situation.means.items()
        ],
        "effects": as_json(situation.effects),
        "runs": [
            {
                **asdict(run.arm),
                "method": run.arm.method,
                "seed": run.seed,
                "folder": named_from(run.run.folder, out),
                **asdict(run.outcome),
                "config_sha256": run.run.config_sha256,
                "weights_sha256": run.run.weights_sha256,
            }
            for run in situation.runs
        ],
    }
