"""The rules that decide what was expected of the crossed design, on outcomes made for them."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import ttest_1samp

from innerattn.experiments.crossed.arms import ARMS, Arm
from innerattn.experiments.crossed.claims import Answer, answers
from innerattn.experiments.crossed.effects import effects
from innerattn.experiments.crossed.outcome import Outcome

EVEN = Outcome(0.02, 0.48, 2.0, 0.7, 0.9, 0.48)
IDLE = replace(EVEN, imbalance=0.4, least_share=0.1, first_share=0.1)

MAKES_EVEN = "attention (mean over λ) makes sharing even under team credit"
MAKES_EVEN_FREE = "attention (λ = 0) makes sharing even under team credit"
RESCUES_MORE = "attention (mean over λ) rescues more"
RESCUES_MORE_FREE = "attention (λ = 0) rescues more"
TEAM_UNEVEN = "team credit makes sharing uneven"
TEAM_IDLE = "team credit leaves a food robot idle with either attention"
HELPERS_EVEN = "helpers credit makes sharing even with either attention"
SHARED_EVEN = "shared parameters make sharing even under team credit"
HELD = "λ = 0.001 keeps attention even"

Outcomes = dict[Arm, dict[int, Outcome]]


def said(outcomes: Outcomes) -> dict[str, Answer]:
    return {one.claim: one for one in answers("mixed", outcomes, effects("mixed", outcomes))}


def scattered(like: Outcome, seed: int, runs: int = 10) -> dict[int, Outcome]:
    rng = np.random.default_rng([seed, 1])
    return {
        run: Outcome(*(np.array(list(vars(like).values())) + rng.normal(0.0, 0.005, 6)).tolist())
        for run in range(runs)
    }


def test_what_was_expected_can_be_confirmed() -> None:
    flat = replace(EVEN, entropy_share=0.999)
    outcomes = {
        arm: scattered(flat if arm.penalty == 1e-3 else EVEN, i)
        if arm.credit == "helpers"
        else scattered(replace(IDLE, entropy_share=0.999 if arm.penalty == 1e-3 else 0.9), i)
        for i, arm in enumerate(ARMS)
    }
    found = said(outcomes)
    assert found[TEAM_IDLE].holds == found[HELPERS_EVEN].holds == found[HELD].holds == "yes"
    assert found[TEAM_IDLE].measured.startswith(
        "inner 10 of 10 (rate 72 to 100 %); uniform 10 of 10 ("
    )
    assert found[TEAM_UNEVEN].holds == "yes"
    assert found[SHARED_EVEN].holds == "no"
    # Both attentions do the same, so neither is to be credited with it.
    assert found[MAKES_EVEN].holds == "no"
    assert found[RESCUES_MORE].holds == "no"


def test_what_was_expected_can_be_refuted() -> None:
    worse = replace(IDLE, score=0.4)
    outcomes = {
        arm: scattered(worse if arm.penalty is None else EVEN, i) for i, arm in enumerate(ARMS)
    }
    found = said(outcomes)
    assert found[MAKES_EVEN].holds == "yes"
    assert found[RESCUES_MORE].holds == "yes"
    assert found[TEAM_IDLE].holds == "no"  # with learnt attention none is idle
    assert found[HELPERS_EVEN].holds == "no"  # with uniform weights one is
    assert found[HELD].holds == "no"
    assert found[SHARED_EVEN].holds == "yes"
    assert found[TEAM_UNEVEN].holds == "no"


def test_runs_of_one_seed_count_once() -> None:
    outcomes = {arm: scattered(EVEN, i) for i, arm in enumerate(ARMS)}
    for arm, seed in ((Arm("team", 0.0), 3), (Arm("team", 1e-3), 3), (Arm("team", None), 7)):
        outcomes[arm][seed] = IDLE
    del outcomes[Arm("team", 1e-4)][5]  # a seed without a run of each arm says nothing
    measured = said(outcomes)[TEAM_IDLE].measured
    assert measured.startswith("inner 1 of 9 (")
    assert "uniform 1 of 10 (" in measured
    low, high = student(
        [
            np.mean([outcomes[Arm("helpers", p)][seed].imbalance for p in (0.0, 1e-4, 1e-3)])
            for seed in range(10)
        ]
    )
    assert f"[{low:.2f}, {high:.2f}], idle 0 of 10" in said(outcomes)[HELPERS_EVEN].measured


def student(values: list[float]) -> tuple[float, float]:
    ends = ttest_1samp(values, 0.0).confidence_interval()
    return float(ends.low), float(ends.high)


@pytest.mark.parametrize("seeds", [0, 1, 2])
def test_few_runs_decide_nothing(seeds: int) -> None:
    few = {arm: scattered(EVEN, i, seeds) for i, arm in enumerate(ARMS)}
    assert {one.holds for one in said(few).values()} == {"undecided"}


def test_a_few_seeds_do_not_say_that_no_robot_is_ever_idle() -> None:
    for seeds, holds in ((9, "undecided"), (10, "yes")):
        outcomes = {arm: scattered(EVEN, i, seeds) for i, arm in enumerate(ARMS)}
        found = said(outcomes)
        assert (found[HELPERS_EVEN].holds, found[SHARED_EVEN].holds) == (holds, holds)
    outcomes[Arm("helpers", 0.0)][4] = IDLE  # one is enough to say that some is
    assert said(outcomes)[HELPERS_EVEN].holds == "no"


@pytest.mark.parametrize(
    ("with_", "without", "holds"),
    [
        (0.02, 0.10, "yes"),
        (0.05, 0.10, "undecided"),
        (0.08, 0.10, "no"),  # more even, and not even
        (0.14, 0.10, "no"),
        (0.01, 0.01, "undecided"),  # nothing was there to be made even
        (0.00, 0.045, "undecided"),
    ],
)
def test_attention_makes_even_what_it_takes_most_unevenness_from(
    with_: float, without: float, holds: str
) -> None:
    outcomes = {
        arm: scattered(replace(EVEN, imbalance=without if arm.penalty is None else with_), i)
        for i, arm in enumerate(ARMS)
    }
    assert said(outcomes)[MAKES_EVEN].holds == holds


def test_attention_that_is_free_is_judged_by_itself() -> None:
    """Regularisation that holds attention even must not decide what free attention does."""
    better = replace(EVEN, score=0.9)
    outcomes = {
        arm: scattered(IDLE if arm.credit == "team" and arm.penalty != 0.0 else EVEN, i)
        for i, arm in enumerate(ARMS)
    }
    found = said(outcomes)
    assert (found[MAKES_EVEN_FREE].holds, found[MAKES_EVEN].holds) == ("yes", "no")
    outcomes = {
        arm: scattered(better if arm.penalty == 1e-3 else EVEN, i) for i, arm in enumerate(ARMS)
    }
    found = said(outcomes)
    assert (found[RESCUES_MORE_FREE].holds, found[RESCUES_MORE].holds) == ("no", "yes")
    seeds = range(10)
    differences = [
        np.mean(
            [
                outcomes[Arm(c, 0.0)][s].score - outcomes[Arm(c, None)][s].score
                for c in ("helpers", "team")
            ]
        )
        for s in seeds
    ]
    low, high = student(differences)
    assert f"[{low:.3f}, {high:.3f}], g " in found[RESCUES_MORE_FREE].measured


def test_where_half_the_unevenness_may_be_gone_nothing_is_said() -> None:
    outcomes = {arm: scattered(EVEN, i) for i, arm in enumerate(ARMS)}
    for seed, uneven in enumerate([0.0, 0.3] * 5):  # a few seeds are uneven without, none with
        outcomes[Arm("team", None)][seed] = replace(EVEN, imbalance=uneven)
        for penalty in (0.0, 1e-4, 1e-3):
            outcomes[Arm("team", penalty)][seed] = replace(EVEN, imbalance=0.1)
    assert said(outcomes)[MAKES_EVEN].holds == "undecided"
