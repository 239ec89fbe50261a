"""The report as Markdown: claims first, then the tables and figures, then the runs they are of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from innerattn.experiments.paper.claims import RULES, Claim, entropy_claims, handoff_claims
from innerattn.experiments.paper.fig4 import EntropyCourse
from innerattn.experiments.paper.fig5 import Evidence
from innerattn.experiments.paper.imbalance_score import imbalance_score_correlations
from innerattn.experiments.paper.pairs import pairs, together
from innerattn.experiments.paper.scene import SCENE_RULE, HandoffScene
from innerattn.experiments.paper.sharing_claims import sharing_claims
from innerattn.experiments.paper.table2 import PRINTED_SITUATION, Table2
from innerattn.experiments.run import FinishedRun, named_from
from innerattn.report.paper.table2 import markdown_table, table2_markdown
from innerattn.stats.text import NONE, format_estimate, format_number, format_p


@dataclass(frozen=True)
class Findings:
    """What runs show; a part that was not asked for is None.

    Attributes:
        budget: name of the budget of training.
        folder: where the report lies.
        runs: all runs, by situation and method, then seed.
        table: Table II.
        courses: Fig. 4.
        scene: the handoff that is shown as Fig. 5; None, too, where there is none to show.
        evidence: Fig. 5 over all handoffs.
        left_out: runs that were planned and are in none of the figures, each with the reason.
    """

    budget: str
    folder: Path
    runs: tuple[FinishedRun, ...]
    table: Table2 | None
    courses: tuple[EntropyCourse, ...] | None
    scene: HandoffScene | None
    evidence: tuple[Evidence, ...] | None
    left_out: tuple[str, ...] = ()

    def claims(self) -> list[Claim]:
        """All claims that can be asked of the parts there are."""
        return [
            *(sharing_claims(self.table) if self.table else []),
            *entropy_claims(self.courses or ()),
            *handoff_claims(self.evidence or ()),
        ]


def report_markdown(findings: Findings) -> str:
    """The whole report."""
    parts = ["# The paper's claims, measured here\n", _opening(findings)]
    if findings.left_out:
        parts += ["**Not in any figure below:**\n", *(f"- {one}" for one in findings.left_out), ""]
    parts.append(_claims(findings))
    if findings.table is not None:
        parts += ["## Table II\n", table2_markdown(findings.table)]
        compared = _compared(findings.table)
        parts += ["## Learnt attention beside uniform weights\n", compared] if compared else []
        parts += ["## Is evenness a merit?\n", _merit(findings.table)]
    if findings.courses is not None:
        parts += ["## Fig. 4: entropy of attention during training\n", _fig4(findings.courses)]
    if findings.evidence is not None:
        parts += ["## Fig. 5: attention when work is handed over\n", _fig5(findings)]
    return "\n".join([*parts, "## Runs\n", _runs(findings)])


def _opening(findings: Findings) -> str:
    seeds = sorted({run.seed for run in findings.runs})
    return (
        f"{len(findings.runs)} runs, budget `{findings.budget}`, training seeds "
        f"{', '.join(map(str, seeds))}. A situation, method and seed name one run; all are listed "
        "at the end with their folders and digests. The paper does not say which situation its "
        f"Table II, Fig. 4 and Fig. 5 are about; {PRINTED_SITUATION} is assumed, since its text "
        "speaks of a variety of tasks.\n"
        f"{_of_worlds(findings, len(seeds))}"
    )


def _of_worlds(findings: Findings, seeds: int) -> str:
    if len({run.config.evaluate.seed for run in findings.runs}) >= seeds:
        return ""
    return (
        "\n**Runs of different seeds were measured in the same worlds.** Chance of these worlds "
        "moves all runs alike, and intervals over runs do not see it: they are too short.\n"
    )


def _claims(findings: Findings) -> str:
    claims = findings.claims()
    assumed = [claim for claim in claims if claim.situation == PRINTED_SITUATION]
    others = [claim for claim in claims if claim.situation != PRINTED_SITUATION]
    if assumed:
        parts = [_claim_table(assumed)]
    elif any(run.situation == PRINTED_SITUATION for run in findings.runs):
        parts = [f"What was asked for decides no claim about {PRINTED_SITUATION}.\n"]
    else:
        parts = [f"There is no {PRINTED_SITUATION} run.\n"]
    if findings.table is not None:
        parts += ["Runs of a task are counted as even / uneven / undecided by themselves.\n"]
    if others:
        parts += ["## The same in the other situations\n", _claim_table(others)]
    parts += ["## How it is decided\n", RULES]
    return "\n".join(parts)


def _claim_table(claims: Sequence[Claim]) -> str:
    order = list(dict.fromkeys(claim.claim for claim in claims))
    head = ["claim", "situation", "method", "printed", "measured here", "runs", "holds?"]
    rows = [
        [c.claim, c.situation, c.method, c.printed, c.measured, str(c.runs), f"**{c.holds}**"]
        for c in sorted(claims, key=lambda claim: order.index(claim.claim))
    ]
    return markdown_table(head, rows)


def _compared(table: Table2) -> str:
    """Both attentions side by side; nothing where no method has both."""
    head = ["situation", "algorithm", "figure", "seeds", "inner", "uniform"]
    head += ["inner − uniform [95 %]", "p", "alike within"]
    rows = []
    for pair in pairs(table.competence):
        found = pair.contrast
        cells = [pair.situation, pair.algorithm, pair.measure, _seeds(pair.seeds) or NONE]
        cells += [format_estimate(pair.inner), format_estimate(pair.uniform)]
        if found is None:
            rows.append([*cells, NONE, NONE, NONE])
            continue
        alike = f"{found.margin:g}: {'yes' if found.equivalent else 'not shown'}"
        rows.append([*cells, format_estimate(found.difference, 3), format_p(found.p), alike])
    if not rows:
        return ""
    head_of_all = ["algorithm", "situations", "inner", "uniform", "a run of inner scores higher"]
    rows_of_all = [
        [
            *(one.algorithm, ", ".join(one.situations)),
            *map(format_estimate, (one.inner, one.uniform, one.better)),
        ]
        for one in together(table.competence)
    ]
    text = (
        "Every seed gives one difference; p is of the paired t-test, and two means are alike where "
        "two one-sided tests at 5 % show them to be within the margin.\n\n"
        + markdown_table(head, rows)
    )
    if not rows_of_all:
        return text
    return text + (
        "\nOver situations: interquartile means of the score, and how probably a run with learnt "
        "attention scores higher than one without (Agarwal et al. 2021), by a bootstrap of runs "
        "within situations, as if runs of one seed had nothing in common; intervals are too short "
        "where runs are few.\n\n" + markdown_table(head_of_all, rows_of_all)
    )


def _merit(table: Table2) -> str:
    head = ["situation", "runs", "correlation of imbalance and score within methods", "p"]
    head += ["imbalance of hungarian", "its score"]
    rows = [
        [
            *(one.situation, str(one.runs)),
            NONE if one.correlation is None else _signed(one.correlation),
            format_p(one.p),
            *(NONE if value is None else format_number(value) for value in one.script),
        ]
        for one in imbalance_score_correlations(table.competence)
    ]
    return (
        "Of a run's imbalance and its score, each minus its method's mean: above 0 where "
        "imbalanced runs score more. p is of a permutation test that exchanges whole seeds, since "
        "runs of one seed are not independent, and of each situation by itself.\n\n"
        + markdown_table(head, rows)
    )


def _fig4(courses: Sequence[EntropyCourse]) -> str:
    head = ["situation", "method", "seeds", "logged [env-steps]", "first tenth [nats]"]
    head += ["last tenth [nats]", "change [nats]", "share of ln(N − 1)", "teammates in effect"]
    rows = []
    for course in courses:
        end, even = course.end.mean, course.even_nats
        steps = course.env_steps
        rows.append(
            [
                *(course.situation, course.method, _seeds(course.seeds)),
                f"{steps[0]:,} to {steps[-1]:,}",
                *map(format_estimate, (course.begin, course.end, course.change)),
                *(f"{end / even:.2f}" if even else NONE, f"{np.exp(end):.2f}"),
            ]
        )
    drawn = any(course.chooses for course in courses)
    picture = "![Entropy of attention during training](fig4.png)\n\n" if drawn else ""
    return picture + (
        "Means over robots and heads; teammates in effect are exp(entropy). Bands are Student's "
        "95 % from three runs on, least to largest of two runs, none of one run. Uniform attention "
        "stays at ln(N − 1). The paper gives 1.02 nats.\n\n" + markdown_table(head, rows)
    )


def _fig5(findings: Findings) -> str:
    if findings.scene is None:
        text = "There is no handoff to show.\n"
    else:
        text = (
            f"![One handoff](fig5.png)\n\nOne handoff ({findings.scene.title}) as an "
            f"illustration. It was chosen by rule: {SCENE_RULE}.\n"
        )
    if not findings.evidence:
        return text + "\nNo run has handoffs and attention that chooses.\n"
    head = ["situation", "method", "seed", "handoffs of all (episodes)"]
    head += ["change on the partner to be"]
    head += ["of the robot that takes no part", "difference", "its ceiling"]
    head += ["difference − half the change"]
    head += ["change on the partner before", "of the robot that takes no part"]
    head += ["p", "p of the robot that takes no part"]
    rows = [row for part in findings.evidence for row in _evidence_rows(part)]
    return text + (
        "\n![All handoffs](fig5_evidence.png)\n\nAll handoffs of both food robots in both "
        "orders of the tasks. Weights are means over heads; a change is the mean after the first "
        "rescue minus that up to it; p is of a permutation test of the change on the partner to "
        "be minus that on the one before, which exchanges the two in some episodes. The control "
        "is the other food robot at the same moments: what it shows too follows from which "
        "victims are there, not from who hands over. Handoffs count during which the control "
        "rescues nobody; the ceiling of the difference is that of attention which follows each "
        "robot's own next rescue.\n\n" + markdown_table(head, rows)
    )


def _evidence_rows(part: Evidence) -> list[list[str]]:
    to_be, control = part.robot["to_be"], part.control["to_be"]
    before, before_control = part.robot["before"], part.control["before"]
    rows = []
    for n, seed in enumerate(part.seeds):
        p_values = (part.p_by_run[n], part.control_p_by_run[n])
        rows.append(
            [
                *(part.situation, part.method, str(seed)),
                f"{part.handoffs[n]} of {part.handoffs[n] + part.left_out[n]} ({part.episodes[n]})",
                *(_signed(role.change_by_run[n]) for role in (to_be, control)),
                *(_signed(part.own_part_by_run[n]), NONE, NONE),
                *(_signed(role.change_by_run[n]) for role in (before, before_control)),
                *map(format_p, p_values),
            ]
        )
    if len(part.seeds) > 1:
        rows.append(
            [
                *(part.situation, part.method, "mean [95 %]", f"{sum(part.handoffs):,}"),
                *(format_estimate(to_be.change), format_estimate(control.change)),
                *map(format_estimate, (part.own_part, part.ceiling, part.own_part_beyond_half)),
                *map(format_estimate, (before.change, before_control.change, None, None)),
            ]
        )
    return rows


def _runs(findings: Findings) -> str:
    head = ["situation", "method", "seed", "folder", "trained [env-steps]"]
    head += ["SHA-256 of the configuration", "SHA-256 of the weights"]
    rows = [
        [
            *(run.situation, run.method, str(run.seed)),
            f"`{named_from(run.folder, findings.folder)}`",
            f"{run.config.train.env_steps:,}",
            f"`{run.config_sha256}`",
            f"`{run.weights_sha256}`" if run.weights_sha256 else NONE,
        ]
        for run in findings.runs
    ]
    return markdown_table(head, rows)


def _seeds(seeds: Sequence[int]) -> str:
    return ", ".join(map(str, seeds))


def _signed(value: float | None) -> str:
    return NONE if value is None else f"{round(value, 2) + 0.0:+.2f}"
