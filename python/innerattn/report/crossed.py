"""The crossed design from finished runs, as files in a folder: report, table and figure."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

from innerattn.config.files import write_whole
from innerattn.experiments.crossed.arms import ARMS, Arm, arm_of
from innerattn.experiments.crossed.claims import RULES, Answer, answers, idle_seeds, idle_shown
from innerattn.experiments.crossed.effects import MARGINS, Effect, effects
from innerattn.experiments.crossed.outcome import IDLE, OUTCOMES, Outcome, outcome_of
from innerattn.experiments.run import FinishedRun, named_from
from innerattn.experiments.smoke import smoke_note
from innerattn.report.paper.table2 import markdown_table
from innerattn.report.plots.arms import ArmDots, ArmPanel, draw_arms
from innerattn.report.plots.drawing import check_format, write_figure
from innerattn.report.smoke import mark_figure, noted_csv, noted_markdown
from innerattn.stats import Estimate
from innerattn.stats.estimate import as_json
from innerattn.stats.seeds import seed_estimate
from innerattn.stats.text import NONE, format_estimate, format_number, format_p

SCHEMA_VERSION = 1

_DRAWN = {
    "imbalance": (
        "workload imbalance",
        (MARGINS["imbalance"],),
        (0.0, 0.5),
    ),
    "least_share": ("share of the idler robot", (IDLE,), (0.0, 0.5)),
    "score": ("score", (), None),
    "entropy_share": ("entropy / ln(N - 1)", (1.0,), (0.0, 1.0)),
}
"""Label, marks and limits of the figures that are drawn."""


@dataclass(frozen=True)
class CrossedRun:
    """A run of the design: how it was trained, and what it shows."""

    arm: Arm
    run: FinishedRun
    outcome: Outcome

    @property
    def seed(self) -> int:
        """The seed of its training."""
        return self.run.seed


@dataclass(frozen=True)
class Situation:
    """What the runs of one situation show."""

    name: str
    runs: tuple[CrossedRun, ...]
    effects: tuple[Effect, ...]
    answers: tuple[Answer, ...]

    def outcomes(self) -> dict[Arm, dict[int, Outcome]]:
        """Figures of the runs by arm and seed; arms without runs are there, empty."""
        return _by_arm(self.runs)


def write_crossed(
    runs: Sequence[FinishedRun], out: Path, budget: str, left_out: Sequence[str] = ()
) -> list[Situation]:
    """Write ``crossed.md``, ``.json``, ``.csv``, ``.pdf`` and ``.png`` into ``out``.

    The same runs give the same bytes.

    Args:
        runs: finished runs of the design, at least one; they are read only.
        out: folder of the study; the runs' folders are named from there.
        budget: name of the budget they were trained with.
        left_out: what is said of runs that were planned and are not among ``runs``.

    Returns:
        What the report says, by situation.

    Raises:
        RunError: a run's evaluation is missing or is not one of two food robots; or matplotlib is
            not installed.
        OSError: a file cannot be written; each is written whole or not at all.
    """
    check_format(out / "crossed.png")
    situations = [_situation(name, runs) for name in _names(runs)]
    document = {
        "schema_version": SCHEMA_VERSION,
        "note": smoke_note(budget),
        "budget": budget,
        "figures": OUTCOMES,
        "situations": [_json(situation, out) for situation in situations],
    }
    text = json.dumps(document, indent=1, allow_nan=False)
    write_whole(out / "crossed.json", f"{text}\n".encode())
    write_whole(out / "crossed.csv", noted_csv(_csv(situations), budget).encode())
    report = _markdown(situations, out, budget, left_out)
    write_whole(out / "crossed.md", noted_markdown(report, budget).encode())
    figure = mark_figure(draw_arms([_panels(situation) for situation in situations]), budget)
    for suffix in (".pdf", ".png"):
        write_figure(out / f"crossed{suffix}", figure)
    return situations


def _names(runs: Sequence[FinishedRun]) -> list[str]:
    return list(dict.fromkeys(run.case.situation for run in runs))


def _situation(name: str, runs: Sequence[FinishedRun]) -> Situation:
    own = [run for run in runs if run.case.situation == name]
    order = {arm: index for index, arm in enumerate(ARMS)}
    own.sort(key=lambda run: (order[arm_of(run.case)], run.case.seed))
    found = tuple(CrossedRun(arm_of(run.case), run, outcome_of(run)) for run in own)
    outcomes = _by_arm(found)
    compared = tuple(effects(name, outcomes))
    return Situation(name, found, compared, tuple(answers(name, outcomes, compared)))


def _by_arm(runs: Sequence[CrossedRun]) -> dict[Arm, dict[int, Outcome]]:
    return {arm: {run.seed: run.outcome for run in runs if run.arm == arm} for arm in ARMS}


def _markdown(
    situations: Sequence[Situation], out: Path, budget: str, left_out: Sequence[str]
) -> str:
    seeds = sorted({run.seed for situation in situations for run in situation.runs})
    count = sum(len(situation.runs) for situation in situations)
    missing = ["**Not in any figure below:**\n", *(f"- {one}" for one in left_out), ""]
    said = [answer for situation in situations for answer in situation.answers]
    parts = [
        "# Does attention cause even sharing?\n",
        f"{count} runs, budget `{budget}`, training seeds {', '.join(map(str, seeds))}: attention "
        "(inner, uniform), rescue credit (helpers, team) and the penalty of attention logits are "
        "crossed, in worlds of their own credit. With uniform weights there are no logits, so one "
        "arm stands for all penalties. In one further arm robots of a kind have the same "
        "parameters.\n",
        *(missing if left_out else []),
        markdown_table(
            ["claim", "situation", "measured here", "holds?"],
            [[a.claim, a.situation, a.measured, f"**{a.holds}**"] for a in said],
        ),
        "## How it is decided\n",
        RULES,
        "![All runs](crossed.png)\n",
        "A dot is a run; bars are means and 95 % intervals over seeds.\n",
    ]
    for situation in situations:
        parts += [f"## {situation.name}\n", _arms_table(situation), _effects_table(situation)]
    return "\n".join([*parts, "## Runs\n", _runs_table(situations, out)])


def _arms_table(situation: Situation) -> str:
    head = ["arm", "runs", "imbalance", "least share", "runs with an idle robot"]
    head += ["rescues per episode", "score", "entropy / ln(N − 1)"]
    rows = []
    outcomes = situation.outcomes()
    for arm, by_seed in outcomes.items():
        runs = list(by_seed.values())
        rows.append(
            [
                *(str(arm), str(len(runs))),
                *(format_estimate(_mean(runs, name)) for name in ("imbalance", "least_share")),
                idle_shown(outcomes, [arm]),
                *(format_estimate(_mean(runs, name)) for name in ("rescues_per_episode", "score")),
                format_estimate(_mean(runs, "entropy_share"), 3),
            ]
        )
    return markdown_table(head, rows)


def _effects_table(situation: Situation) -> str:
    head = ["effect", "on", "seeds", "difference [95 %]", "Hedges g [95 %]", "p", "p (Holm)"]
    head += ["alike within"]
    rows = []
    for effect in situation.effects:
        found = effect.found
        name = f"**{effect.name}**" if effect.main else effect.name
        cells = [name, effect.figure.replace("_", " "), str(effect.seeds)]
        if found is None or effect.holm_p is None:
            rows.append([*cells, *[NONE] * 5])
            continue
        alike = f"{found.margin:g}: {'yes' if found.equivalent else 'not shown'}"
        cells += [format_estimate(found.difference, 3), format_estimate(found.hedges_g, 1)]
        rows.append([*cells, format_p(found.p), format_p(effect.holm_p), alike])
    return markdown_table(head, rows)


def _runs_table(situations: Sequence[Situation], out: Path) -> str:
    head = ["situation", "arm", "seed", "imbalance", "least share", "score", "folder"]
    head += ["SHA-256 of the configuration", "SHA-256 of the weights"]
    rows = []
    for situation in situations:
        for run in situation.runs:
            outcome = run.outcome
            figures = (outcome.imbalance, outcome.least_share, outcome.score)
            rows.append(
                [
                    *(situation.name, str(run.arm), str(run.seed)),
                    *(NONE if value is None else format_number(value) for value in figures),
                    f"`{named_from(run.run.folder, out)}`",
                    f"`{run.run.config_sha256}`",
                    f"`{run.run.weights_sha256}`" if run.run.weights_sha256 else NONE,
                ]
            )
    return markdown_table(head, rows)


def _csv(situations: Sequence[Situation]) -> str:
    """One line per run."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    names = [field.name for field in fields(Outcome)]
    writer.writerow(["situation", "method", "credit", "penalty", "shared", "seed", *names])
    for situation in situations:
        for run in situation.runs:
            arm = run.arm
            values = [getattr(run.outcome, name) for name in names]
            writer.writerow(
                [
                    *(situation.name, arm.method, arm.credit, arm.penalty, arm.shared, run.seed),
                    *values,
                ]
            )
    return text.getvalue()


def _json(situation: Situation, out: Path) -> dict[str, Any]:
    outcomes = situation.outcomes()
    return {
        "situation": situation.name,
        "answers": [asdict(answer) for answer in situation.answers],
        "arms": [
            {
                **asdict(arm),
                "method": arm.method,
                "runs": len(runs),
                "idle": idle_seeds(outcomes, [arm])[0],
                "mean": {
                    name: mean.to_json() if (mean := _mean(list(runs.values()), name)) else None
                    for name in OUTCOMES
                },
            }
            for arm, runs in outcomes.items()
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


def _panels(situation: Situation) -> list[ArmPanel]:
    panels = []
    for name, (label, marks, limits) in _DRAWN.items():
        dots = []
        for arm, by_seed in situation.outcomes().items():
            runs = list(by_seed.values())
            mean = _mean(runs, name)
            values = tuple(value for run in runs if (value := getattr(run, name)) is not None)
            bar = None
            if mean is not None and mean.bounded:
                bar = (mean.mean, mean.low, mean.high)
            dots.append(ArmDots(str(arm), arm.penalty is not None, values, bar))
        panels.append(ArmPanel(situation.name, label, tuple(dots), marks, limits))
    return panels


def _mean(runs: Sequence[Outcome], name: str) -> Estimate | None:
    return seed_estimate([getattr(run, name) for run in runs])
