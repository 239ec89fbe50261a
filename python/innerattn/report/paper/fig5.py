"""The evidence of Fig. 5 as the lines of a plot."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from innerattn.experiments.paper.fig5 import ROLES, Evidence
from innerattn.report.plots.aligned import AlignedLines
from innerattn.stats.seeds import BAND_NAMES


def evidence_lines(found: Sequence[Evidence]) -> list[AlignedLines]:
    """What is drawn."""
    lines = []
    for part in found:
        kind = part.robot["to_be"].weight.kind
        runs = "1 run" if part.runs == 1 else f"{part.runs} runs ({BAND_NAMES[kind]})"
        robot, control = (
            np.stack([np.stack([w.mean, w.low, w.high]) for w in (of[r].weight for r in ROLES)])
            for of in (part.robot, part.control)
        )
        lines.append(
            AlignedLines(
                situation=part.situation,
                method=part.method,
                runs=f"{runs}, {sum(part.handoffs):,} handoffs",
                offsets=part.offsets,
                step_s=part.step_s,
                even=part.even,
                robot=robot,
                control=control,
            )
        )
    return lines
