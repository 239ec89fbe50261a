"""The report on the paper's claims as Markdown: a short page, and all claims in full beside it."""

from __future__ import annotations

from collections.abc import Sequence

from innerattn.experiments.paper.claims import RULES
from innerattn.experiments.paper.findings import Findings
from innerattn.experiments.paper.scene import SCENE_RULE
from innerattn.experiments.paper.table2 import PRINTED_SITUATION, Table2
from innerattn.report.folder import left_out_list
from innerattn.report.paper.claims import claims_summary, claims_table
from innerattn.report.paper.competence import imbalance_score_table, pairs_summary
from innerattn.report.paper.fig4 import entropy_table, logged
from innerattn.report.paper.fig5 import evidence_summary
from innerattn.report.paper.table2 import sharing_summary
from innerattn.report.table import markdown
from innerattn.stats.text import format_seeds

_FILES = {
    "table2": "[table2.md](table2.md) has all situations, every run and competence, "
    "[table2.csv](table2.csv) the same as values.",
    "evidence": "[fig5_evidence.md](fig5_evidence.md) has the handoffs of every run.",
    "runs": "[runs.csv](runs.csv) names every run with its digests.",
}


def report_page(findings: Findings, budget: str, left_out: Sequence[str]) -> str:
    """The page: what holds, how it is decided, and the results behind it.

    Args:
        findings: what the runs show.
        budget: name of the budget of training.
        left_out: runs that were planned and are not there, each with the reason.
    """
    parts = ["# Which of the paper's claims hold?\n", *left_out_list(left_out)]
    parts += [_opening(findings, budget), "## How claims are decided\n", RULES]
    if findings.table is not None:
        parts += [_sharing(findings.table), _compared(findings.table)]
    if findings.courses is not None:
        parts.append(_fig4(findings))
    if findings.evidence is not None:
        parts.append(_fig5(findings))
    return "\n".join([*parts, _files(findings)])


def claims_page(findings: Findings) -> str:
    """Every claim of every situation and method, in full."""
    text = (
        "# All claims in full\n\n"
        "Shares are those of the first food robot, with 95 % intervals over runs. *Runs* counts "
        "runs that are even / uneven / undecided by themselves. An imbalance is the distance of a "
        "share from 0.5, a mean over tasks. Changes of attention are changes of a weight.\n"
    )
    if not findings.claims:
        return f"{text}\nWhat was asked for decides no claim.\n"
    return f"{text}\n{markdown(claims_table(findings.claims))}"


def _opening(findings: Findings, budget: str) -> str:
    seeds = sorted({run.seed for run in findings.runs})
    table = "What was asked for decides no claim.\n"
    if findings.claims:
        table = markdown(claims_summary(findings.claims))
    text = (
        f"{table}\n{len(findings.runs)} runs, budget `{budget}`, seeds {format_seeds(seeds)}. "
        "A cell that names no algorithm is about all. Shares are those of the first food robot, "
        "by task; changes are means over runs. The paper does not say which situation it shows; we "
        f"assume {PRINTED_SITUATION}, since its text speaks of a variety of tasks. "
        "[claims.md](claims.md) has every claim in full.\n"
    )
    if findings.share_worlds:
        text += (
            "\n**Runs of different seeds were measured in the same worlds.** Chance of these "
            "worlds moves all runs alike, so intervals over runs are too short.\n"
        )
    return text


def _sharing(table: Table2) -> str:
    situations = {row.situation for row in table.rows}
    shown = PRINTED_SITUATION if PRINTED_SITUATION in situations else table.rows[0].situation
    episodes = " or ".join(
        f"{count:,}" for count in sorted({row.scored.episodes for row in table.rows})
    )
    return (
        f"## Table II: sharing in {shown}\n\n{markdown(sharing_summary(table, shown))}\n"
        f"Over {episodes} episodes of each run. The verdict is on the mean over runs; single runs "
        f"are counted beside it. {_FILES['table2']}\n"
    )


def _compared(found: Table2) -> str:
    text = ""
    if found.pairs:
        text += (
            "## Learnt attention beside uniform attention\n\n"
            f"{markdown(pairs_summary(found.pairs))}\n"
            "Each seed gives one difference. *Alike*: two one-sided tests at 5 % put the "
            "difference within the margin. Means and p-values are in [table2.md](table2.md).\n"
        )
    if found.imbalance_score:
        text += (
            f"{chr(10) if text else ''}## Do uneven runs score more?\n\n"
            f"{markdown(imbalance_score_table(found.imbalance_score))}\n"
            "Correlation of a run's imbalance and its score, each minus its method's mean: above 0 "
            "if uneven runs score more. p is of a permutation test that exchanges whole seeds, "
            "since runs of one seed are not independent, and of each situation by itself.\n"
        )
    return text


def _fig4(findings: Findings) -> str:
    courses = findings.courses or ()
    title = "## Fig. 4: entropy of attention in training\n\n"
    if not any(course.chooses for course in courses):
        return f"{title}No run has attention that chooses.\n"
    return (
        f"{title}![Entropy of attention in training](fig4.png)\n\n"
        f"{markdown(entropy_table(courses))}\n"
        "Black: mean over robots and heads with its band over runs. Colours: kinds of robots, with "
        "a dash for a second robot of a kind. Dots at the right: every head of every run, mean "
        "over the last tenth of training. Uniform attention "
        f"stays at ln(N − 1). Logged at {logged(courses)} env-steps.{_made_of(findings)}\n"
    )


def _fig5(findings: Findings) -> str:
    text = "## Fig. 5: attention at a handoff\n\n"
    if findings.evidence:
        table = markdown(evidence_summary(findings.evidence))
        text += (
            f"![All handoffs](fig5_evidence.png)\n\n{table}\n"
            "Handoffs of both food robots, in both orders of the tasks. A change is the mean "
            "weight after the first rescue minus that before, a mean over heads. The *bystander* "
            "is the other food robot: what it shows too follows from which victims are there, not "
            "from who hands over. Only handoffs count during which it rescues nobody. The ceiling "
            "is the difference that attention would show which follows each robot's own next "
            f"rescue.{_made_of(findings)} {_FILES['evidence']}\n"
        )
    else:
        text += "No run has handoffs and attention that chooses.\n"
    if findings.scene is None:
        return f"{text}\nThere is no handoff to show.\n"
    return (
        f"{text}\n![One handoff](fig5.png)\n\n"
        f"One handoff as an illustration: {findings.scene.title}. A rule chose it that looks at no "
        f"attention: {SCENE_RULE}.\n"
    )


def _made_of(findings: Findings) -> str:
    """Which runs a figure is made of, where it is not all."""
    runs = findings.in_full
    if len(runs) == len(findings.runs):
        return ""
    methods = ", ".join(dict.fromkeys(run.method for run in runs))
    seeds = format_seeds(sorted({run.seed for run in runs}))
    return f" Made of {len(runs)} runs, {methods} with seeds {seeds}: the others are archived."


def _files(findings: Findings) -> str:
    return f"## Runs\n\n{len(findings.runs)} runs. {_FILES['runs']}\n"
