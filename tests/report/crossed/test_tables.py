"""The cells of the crossed design's tables are the numbers that were found."""

import numpy as np
from markdown_rows import rows_of

from innerattn.experiments.crossed.arms import ARMS
from innerattn.experiments.crossed.effects import effects
from innerattn.experiments.crossed.outcome import Outcome
from innerattn.report.crossed.tables import effects_table
from innerattn.report.table import markdown
from innerattn.stats.text import format_estimate, format_p


def test_effects() -> None:
    rng = np.random.default_rng(0)
    outcomes = {arm: {s: Outcome(*rng.uniform(size=6)) for s in range(4)} for arm in ARMS}
    for seed in range(2):  # no run of a seed has the arm, so that too few are left
        del outcomes[ARMS[-1]][seed]
    found = effects("mixed", outcomes)
    rows = rows_of(markdown(effects_table(found)))[1:]
    assert len(rows) == len(found)
    for row, effect in zip(rows, found, strict=True):
        assert row[0] == (f"**{effect.name}**" if effect.main else effect.name)
        assert row[2] == str(effect.seeds)
        if effect.contrast is None:
            assert row[3:] == ["–"] * 6
            continue
        one = effect.contrast
        assert row[3:6] == [
            format_estimate(one.difference, 3),
            format_estimate(one.hedges_g, 1),
            format_p(one.p),
        ]
        alike = "yes" if one.equivalent else "not shown"
        assert row[6:] == [format_p(effect.holm_p), f"{one.margin:g}", alike]
    assert sum(effect.contrast is None for effect in found) == 3
