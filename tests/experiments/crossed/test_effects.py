"""Effects of the crossed design against plain sums and other libraries."""

import numpy as np
import pytest
from scipy.stats import ttest_rel
from statsmodels.stats.multitest import multipletests

from innerattn.experiments.crossed.arms import ARMS, Arm
from innerattn.experiments.crossed.effects import ATTENTION, CREDIT, contrasts, effects
from innerattn.experiments.crossed.outcome import Outcome

Outcomes = dict[Arm, dict[int, Outcome]]


def random_outcomes(seed: int, runs: int = 4) -> Outcomes:
    rng = np.random.default_rng(seed)
    return {arm: {seed: Outcome(*rng.uniform(size=6)) for seed in range(runs)} for arm in ARMS}


def test_contrasts_compare_whole_means() -> None:
    names = [name for name, _, _ in contrasts()]
    assert len(set(names)) == len(names)
    for name, _, weights in contrasts():
        plus = sum(weight for weight in weights.values() if weight > 0)
        minus = sum(weight for weight in weights.values() if weight < 0)
        whole = 2.0 if name.startswith("(") else 1.0
        assert (plus, minus) == pytest.approx((whole, -whole)), name


@pytest.mark.parametrize("figure", ["imbalance", "score", "entropy_share"])
def test_effects_against_plain_means(figure: str) -> None:
    outcomes = random_outcomes(3)
    mean = {
        (arm.credit, arm.penalty): np.mean([getattr(run, figure) for run in runs.values()])
        for arm, runs in outcomes.items()
        if not arm.shared
    }
    alike = outcomes[Arm("team", 0.0, shared=True)].values()
    shared = np.mean([getattr(run, figure) for run in alike])
    found = {e.name: e.contrast for e in effects("mixed", outcomes) if e.outcome == figure}
    inner = {c: np.mean([mean[c, p] for p in (0.0, 1e-4, 1e-3)]) for c in ("helpers", "team")}
    uniform = {c: mean[c, None] for c in inner}
    expected = {
        ATTENTION: np.mean(
            [inner["helpers"] - uniform["helpers"], inner["team"] - uniform["team"]]
        ),
        "inner − uniform under team credit, mean over λ": inner["team"] - uniform["team"],
        CREDIT: np.mean([inner["team"] - inner["helpers"], uniform["team"] - uniform["helpers"]]),
        "λ = 0.001 − λ = 0, mean over credits": np.mean(
            [mean[c, 1e-3] - mean[c, 0.0] for c in ("helpers", "team")]
        ),
        "(inner − uniform) under team − under helpers credit": (inner["team"] - uniform["team"])
        - (inner["helpers"] - uniform["helpers"]),
        "inner λ = 0.0001 − uniform, team": mean["team", 1e-4] - uniform["team"],
        "team − helpers credit, uniform": uniform["team"] - uniform["helpers"],
        "team − helpers credit, inner λ = 0": mean["team", 0.0] - mean["helpers", 0.0],
        "λ = 0.0001 − λ = 0, helpers": mean["helpers", 1e-4] - mean["helpers", 0.0],
        "shared parameters − own parameters, team, inner λ = 0": shared - mean["team", 0.0],
    }
    for name, difference in expected.items():
        one = found[name]
        assert one is not None
        assert one.difference.mean == pytest.approx(difference), name
    pair = [
        [getattr(run, figure) for run in outcomes[Arm("team", penalty)].values()]
        for penalty in (1e-4, None)
    ]
    one = found["inner λ = 0.0001 − uniform, team"]
    assert one is not None
    assert one.p == pytest.approx(ttest_rel(*pair).pvalue)


def test_p_values_are_adjusted_among_all_of_their_kind() -> None:
    for main in (True, False):
        kind = [one for one in effects("mixed", random_outcomes(5)) if one.main == main]
        p_values = [one.contrast.p for one in kind if one.contrast]
        assert len(p_values) == len(kind) == 3 * sum(m == main for _, m, _ in contrasts())
        expected = multipletests(p_values, method="holm")[1]
        assert [one.holm_p for one in kind] == pytest.approx(list(expected))


def test_effects_need_three_seeds_with_all_arms() -> None:
    outcomes = random_outcomes(1)
    for seed in (0, 2):
        del outcomes[Arm("team", None)][seed]
    del outcomes[Arm("team", 0.0)][3]
    found = {e.name: e for e in effects("mixed", outcomes) if e.outcome == "score"}
    assert found["team − helpers credit, uniform"].contrast is None
    assert found["team − helpers credit, uniform"].seeds == 2
    assert found["team − helpers credit, inner λ = 0"].contrast is not None
    assert found["team − helpers credit, inner λ = 0"].seeds == 3
    assert found["inner λ = 0 − uniform, team"].seeds == 1
    assert all(one.contrast is None for one in effects("mixed", {}))
