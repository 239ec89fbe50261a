"""What the figures of the crossed design draw."""

from __future__ import annotations

from collections.abc import Sequence

from innerattn.experiments.crossed.arms import CREDITS, CROSSED
from innerattn.experiments.crossed.effects import MARGINS
from innerattn.experiments.crossed.outcome import IDLE
from innerattn.experiments.crossed.study import Situation
from innerattn.report.plots.arms import ArmDots, ArmPanel
from innerattn.report.plots.seeds import SeedDots, SeedPanel

_DRAWN = {
    "imbalance": ("imbalance", (MARGINS["imbalance"],), (0.0, 0.5)),
    "least_share": ("smaller share", (IDLE,), (0.0, 0.5)),
    "score": ("score", (), None),
    "entropy_share": ("entropy / ln(N − 1)", (1.0,), (0.0, 1.0)),
}
"""Label, marks and limits of what is drawn of all arms."""


def arm_panels(situation: Situation) -> list[ArmPanel]:
    """A panel for each result, with all arms."""
    outcomes = situation.outcomes()
    panels = []
    for name, (label, marks, limits) in _DRAWN.items():
        dots = []
        for arm, by_seed in outcomes.items():
            mean = situation.means[arm][name]
            values = (getattr(outcome, name) for outcome in by_seed.values())
            bar = None
            if mean is not None and mean.low is not None and mean.high is not None:
                bar = (mean.mean, mean.low, mean.high)
            known = tuple(value for value in values if value is not None)
            dots.append(ArmDots(str(arm), arm.penalty is not None, known, bar))
        panels.append(ArmPanel(situation.name, label, tuple(dots), marks, limits))
    return panels


def seed_panels(situations: Sequence[Situation]) -> list[list[SeedPanel]]:
    """A row for each credit, the team's first, a panel for each situation."""
    rows = []
    for credit in reversed(CREDITS):
        row = []
        for situation in situations:
            outcomes = situation.outcomes()
            dots = [
                SeedDots(
                    "uniform" if arm.penalty is None else f"inner, λ = {arm.penalty:g}",
                    {
                        seed: outcome.first_share
                        for seed, outcome in outcomes[arm].items()
                        if outcome.first_share is not None
                    },
                )
                for arm in CROSSED
                if arm.credit == credit
            ]
            row.append(SeedPanel(f"{situation.name}, {credit} credit", tuple(dots)))
        rows.append(row)
    return rows
