"""All that the paper's table, figures and claims need from finished runs, found once."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

from innerattn.experiments.paper.claims import CLAIMS, Claim, entropy_claims, handoff_claims
from innerattn.experiments.paper.fig4 import EntropyCourse, fig4
from innerattn.experiments.paper.fig5 import Evidence, evidence
from innerattn.experiments.paper.scene import HandoffScene, choose_scene
from innerattn.experiments.paper.sharing_claims import sharing_claims
from innerattn.experiments.paper.table2 import PRINTED_SITUATION, Table2, table2
from innerattn.experiments.run import (
    FinishedRun,
    by_method,
    refuse_unlike,
    refuse_without_steps,
)

PARTS = ("table2", "fig4", "fig5")
"""What can be asked for."""


@dataclass(frozen=True)
class Findings:
    """What runs show; a part that was not asked for is None.

    Attributes:
        runs: all runs, by situation and method, then seed.
        in_full: those that are not archived, which Fig. 4 and Fig. 5 are made of.
        claims: all claims that can be asked of the parts, in the order of `CLAIMS`.
        table: Table II.
        courses: Fig. 4.
        scene: the handoff that is shown as Fig. 5; None, too, where there is none to show.
        evidence: Fig. 5 over all handoffs.
    """

    runs: tuple[FinishedRun, ...]
    in_full: tuple[FinishedRun, ...]
    claims: tuple[Claim, ...]
    table: Table2 | None
    courses: tuple[EntropyCourse, ...] | None
    scene: HandoffScene | None
    evidence: tuple[Evidence, ...] | None

    @property
    def share_worlds(self) -> bool:
        """Whether runs of different seeds were measured in the same worlds."""
        worlds = {run.config.evaluate.seed for run in self.runs}
        return len(worlds) < len({run.seed for run in self.runs})


def find(runs: Sequence[FinishedRun], parts: Collection[str] = PARTS) -> Findings:
    """What runs show.

    Args:
        runs: finished runs; they are read only. Archived runs are enough for the table; Fig. 4 and
            Fig. 5 are made of the others.
        parts: which of `PARTS`.

    Raises:
        RunError: runs are missing or cannot be compared, or a part needs what was not recorded.
        ValueError: a part is unknown.
    """
    if unknown := sorted(set(parts) - set(PARTS)):
        raise ValueError(f"parts = {unknown}: known are {', '.join(PARTS)}")
    groups = list(by_method(runs).values())
    ordered = tuple(run for group in groups for run in group)
    refuse_unlike(ordered)
    in_full = tuple(run for run in ordered if not run.archived)
    groups_in_full = list(by_method(in_full).values()) if in_full else []
    if "fig5" in parts:
        refuse_without_steps(in_full)
    table = table2(groups) if "table2" in parts else None
    courses = None
    if "fig4" in parts:
        courses = tuple(fig4(in_full)) if in_full else ()
    found = tuple(filter(None, map(evidence, groups_in_full))) if "fig5" in parts else None
    claims = [
        *(sharing_claims(table) if table else []),
        *entropy_claims(courses or ()),
        *handoff_claims(found or ()),
    ]
    return Findings(
        runs=ordered,
        in_full=in_full,
        claims=tuple(sorted(claims, key=lambda claim: CLAIMS.index(claim.claim))),
        table=table,
        courses=courses,
        scene=_scene(groups_in_full) if "fig5" in parts else None,
        evidence=found,
    )


def _scene(groups: Sequence[Sequence[FinishedRun]]) -> HandoffScene | None:
    """A handoff of TD with inner attention in the mixed situation, or of what comes nearest."""

    def distance(group: Sequence[FinishedRun]) -> tuple[bool, bool]:
        run = group[0]
        return run.situation != PRINTED_SITUATION, run.method != "td-inner"

    scenes = (choose_scene(group) for group in sorted(groups, key=distance))
    return next((scene for scene in scenes if scene is not None), None)
