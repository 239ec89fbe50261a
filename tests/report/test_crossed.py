"""The crossed design: its arms, what a run shows, effects against plain sums, rules, files."""

import csv
import json
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import ttest_1samp, ttest_rel
from statsmodels.stats.multitest import multipletests

from innerattn.errors import RunError
from innerattn.experiments.crossed.arms import ARMS, Arm, arm_of, plan_crossed
from innerattn.experiments.crossed.claims import Answer, answers
from innerattn.experiments.crossed.effects import contrasts, effects
from innerattn.experiments.crossed.outcome import Outcome, outcome_of
from innerattn.experiments.plan import PlannedRun
from innerattn.experiments.run import FinishedRun
from innerattn.report.crossed import write_crossed
from innerattn.train.weights import digest_of

OUT = Path("study")
METHODS = ("td-inner", "td-uniform")
EVEN = Outcome(0.02, 0.48, 2.0, 0.7, 0.9)
IDLE = replace(EVEN, imbalance=0.4, least_share=0.1)

Outcomes = dict[Arm, dict[int, Outcome]]


def planned(out: Path = OUT, seeds: range = range(2)) -> list[PlannedRun]:
    return plan_crossed(METHODS, ("single", "mixed"), seeds, "quick", out)


def test_all_combinations_are_planned_and_are_what_they_say() -> None:
    runs = planned()
    assert len({one.folder for one in runs}) == len(runs) == 2 * 2 * 9
    found = set()
    for one in runs:
        config, arm = one.config, arm_of(one.case)
        assert config.scenario.situation == one.case.situation
        assert (config.train.method, config.train.seed) == (one.case.method, one.case.seed)
        assert config.network.attention == one.case.method.removeprefix("td-")
        assert config.scenario.rescue_credit == arm.credit
        if arm.penalty is not None:
            assert config.td.attention_logit_penalty == arm.penalty
        assert config.network.parameter_sharing == ("kind" if arm.shared else "none")
        found.add((one.case.situation, one.case.seed, arm))
    assert found == set(product(("single", "mixed"), range(2), ARMS))
    assert [arm for arm in ARMS if arm.shared] == [Arm("team", 0.0, shared=True)]
    inner = {(arm.credit, arm.penalty) for arm in ARMS if arm.method == "td-inner"}
    assert inner == set(product(("helpers", "team"), (0.0, 1e-4, 1e-3)))
    alone = plan_crossed(("td-uniform",), ("single",), (0,), "quick", OUT)
    assert [one.case.variant for one in alone] == ["helpers", "team"]


def random_outcomes(seed: int, runs: int = 4) -> Outcomes:
    rng = np.random.default_rng(seed)
    return {arm: {seed: Outcome(*rng.uniform(size=5)) for seed in range(runs)} for arm in ARMS}


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
    found = {e.name: e.found for e in effects("mixed", outcomes) if e.figure == figure}
    inner = {c: np.mean([mean[c, p] for p in (0.0, 1e-4, 1e-3)]) for c in ("helpers", "team")}
    uniform = {c: mean[c, None] for c in inner}
    expected = {
        "inner - uniform, over credits and penalties": np.mean(
            [inner["helpers"] - uniform["helpers"], inner["team"] - uniform["team"]]
        ),
        "inner - uniform with the team's credit, over penalties": inner["team"] - uniform["team"],
        "team - helpers, over attentions and penalties": np.mean(
            [inner["team"] - inner["helpers"], uniform["team"] - uniform["helpers"]]
        ),
        "penalty 0.001 - 0, over credits": np.mean(
            [mean[c, 1e-3] - mean[c, 0.0] for c in ("helpers", "team")]
        ),
        "(inner - uniform) with team - with helpers": (inner["team"] - uniform["team"])
        - (inner["helpers"] - uniform["helpers"]),
        "inner at penalty 0.0001 - uniform, team": mean["team", 1e-4] - uniform["team"],
        "team - helpers, uniform": uniform["team"] - uniform["helpers"],
        "team - helpers, inner at penalty 0": mean["team", 0.0] - mean["helpers", 0.0],
        "penalty 0.0001 - 0, helpers": mean["helpers", 1e-4] - mean["helpers", 0.0],
        "parameters shared by kind - each robot's own, team, inner at penalty 0": shared
        - mean["team", 0.0],
    }
    for name, difference in expected.items():
        one = found[name]
        assert one is not None
        assert one.difference.mean == pytest.approx(difference), name
    pair = [
        [getattr(run, figure) for run in outcomes[Arm("team", penalty)].values()]
        for penalty in (1e-4, None)
    ]
    one = found["inner at penalty 0.0001 - uniform, team"]
    assert one is not None
    assert one.p == pytest.approx(ttest_rel(*pair).pvalue)


def test_p_values_are_adjusted_among_all_of_their_kind() -> None:
    for main in (True, False):
        kind = [one for one in effects("mixed", random_outcomes(5)) if one.main == main]
        p_values = [one.found.p for one in kind if one.found]
        assert len(p_values) == len(kind) == 3 * sum(m == main for _, m, _ in contrasts())
        expected = multipletests(p_values, method="holm")[1]
        assert [one.holm_p for one in kind] == pytest.approx(list(expected))


def test_effects_need_three_seeds_with_all_arms() -> None:
    outcomes = random_outcomes(1)
    for seed in (0, 2):
        del outcomes[Arm("team", None)][seed]
    del outcomes[Arm("team", 0.0)][3]
    found = {e.name: e for e in effects("mixed", outcomes) if e.figure == "score"}
    assert found["team - helpers, uniform"].found is None
    assert found["team - helpers, uniform"].seeds == 2
    assert found["team - helpers, inner at penalty 0"].found is not None
    assert found["team - helpers, inner at penalty 0"].seeds == 3
    assert found["inner at penalty 0 - uniform, team"].seeds == 1
    assert all(one.found is None for one in effects("mixed", {}))


def said(outcomes: Outcomes) -> dict[str, Answer]:
    return {one.claim: one for one in answers("mixed", outcomes, effects("mixed", outcomes))}


def scattered(like: Outcome, seed: int, runs: int = 10) -> dict[int, Outcome]:
    rng = np.random.default_rng(seed)
    return {
        run: Outcome(*(np.array(list(vars(like).values())) + rng.normal(0.0, 0.005, 5)).tolist())
        for run in range(runs)
    }


MAKES_EVEN = "attention makes sharing even under the team's credit"
TEAM_IDLE = "the team's credit leaves a food robot idle with either attention"
HELPERS_EVEN = "with the helpers' credit sharing is even with either attention"
SHARED_EVEN = "robots of a kind with the same parameters share evenly under the team's credit, too"
HELD = "a penalty of 0.001 holds attention even"


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
    assert found[TEAM_IDLE].measured.startswith("inner: 10 of 10 [0.72, 1.00]; uniform: 10 of 10 [")
    assert found["the team's credit makes sharing uneven"].holds == "yes"
    assert found[SHARED_EVEN].holds == "no"
    # Both attentions do the same, so neither is to be credited with it.
    assert found[MAKES_EVEN].holds == "no"
    assert found["attention rescues more"].holds == "no"


def test_what_was_expected_can_be_refuted() -> None:
    worse = replace(IDLE, score=0.4)
    outcomes = {
        arm: scattered(worse if arm.penalty is None else EVEN, i) for i, arm in enumerate(ARMS)
    }
    found = said(outcomes)
    assert found[MAKES_EVEN].holds == "yes"
    assert found["attention rescues more"].holds == "yes"
    assert found[TEAM_IDLE].holds == "no"  # with learnt attention none is idle
    assert found[HELPERS_EVEN].holds == "no"  # with uniform weights one is
    assert found[HELD].holds == "no"
    assert found[SHARED_EVEN].holds == "yes"
    assert found["the team's credit makes sharing uneven"].holds == "no"


def test_runs_of_one_seed_count_once() -> None:
    outcomes = {arm: scattered(EVEN, i) for i, arm in enumerate(ARMS)}
    for arm, seed in ((Arm("team", 0.0), 3), (Arm("team", 1e-3), 3), (Arm("team", None), 7)):
        outcomes[arm][seed] = IDLE
    del outcomes[Arm("team", 1e-4)][5]  # a seed without a run of each arm says nothing
    measured = said(outcomes)[TEAM_IDLE].measured
    assert measured.startswith("inner: 1 of 9 [")
    assert "uniform: 1 of 10 [" in measured
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


def test_where_half_the_unevenness_may_be_gone_nothing_is_said() -> None:
    outcomes = {arm: scattered(EVEN, i) for i, arm in enumerate(ARMS)}
    for seed, uneven in enumerate([0.0, 0.3] * 5):  # a few seeds are uneven without, none with
        outcomes[Arm("team", None)][seed] = replace(EVEN, imbalance=uneven)
        for penalty in (0.0, 1e-4, 1e-3):
            outcomes[Arm("team", penalty)][seed] = replace(EVEN, imbalance=0.1)
    assert said(outcomes)[MAKES_EVEN].holds == "undecided"


def test_outcome_against_a_plain_loop(runs: list[FinishedRun]) -> None:
    measured = runs[0]
    found = outcome_of(measured)
    scenario = measured.recorded.scenario
    by_index = dict(enumerate(task.name for task in scenario.tasks))
    helped = {name: [0, 0] for name in by_index.values()}
    for record in measured.scored:
        for event in record.rescues:
            for need, ability in enumerate(scenario.tasks[event["task"]].needs):
                if ability == "food":
                    robot = int(event[f"helper_{need}"])
                    helped[by_index[int(event["task"])]][robot] += 1
    distances = [abs(first / (first + second) - 0.5) for first, second in helped.values()]
    total = np.sum(list(helped.values()), axis=0)
    assert found.imbalance == pytest.approx(np.mean(distances))
    assert found.least_share == pytest.approx(min(total) / sum(total))
    assert found.rescues_per_episode == measured.summary["rescues_per_episode"]["mean"]
    shares = np.concatenate(list(measured.summary["attention_entropy_share"].values()))
    assert found.entropy_share == pytest.approx(shares.mean())


def test_a_task_that_two_robots_do_not_share_is_refused(runs: list[FinishedRun]) -> None:
    measured = runs[0]
    robots = measured.recorded.scenario.robots
    third = robots[0].model_copy(update={"name": "food_2"})
    changed = measured.recorded.scenario.replace(robots=[*robots, third])
    scored = tuple(replace(record, scenario=changed) for record in measured.scored)
    with pytest.raises(RunError, match="is shared by 3 robots; must be two"):
        outcome_of(replace(measured, read=lambda: scored))


def test_files_are_the_same_twice_and_name_every_run(
    crossed_study: tuple[Path, list[FinishedRun]],
) -> None:
    out, runs = crossed_study
    names = [f"crossed.{kind}" for kind in ("md", "json", "csv", "pdf", "png")]
    write_crossed(runs, out, "quick", ["mixed td-inner seed 9: failed"])
    before = {name: (out / name).read_bytes() for name in names}
    write_crossed(runs[::-1], out, "quick", ["mixed td-inner seed 9: failed"])
    assert {name: (out / name).read_bytes() for name in names} == before

    text = before["crossed.md"].decode()
    assert text.index("smoke run") < text.index("mixed td-inner seed 9: failed")
    assert text.index("| claim |") < text.index("## mixed") < text.index("## Runs")
    for run in runs:
        weights = run.folder / "checkpoints" / "0" / "weights.safetensors"
        assert f"`runs/{run.folder.name}`" in text
        assert f"`{digest_of(weights)}`" in text
    document = json.loads(before["crossed.json"])
    (situation,) = document["situations"]
    assert len(situation["runs"]) == len(runs) == 18
    assert "smoke run" in document["note"]
    rows = list(csv.DictReader(before["crossed.csv"].decode().splitlines()))
    assert {row["note"] for row in rows} == {document["note"]}
    by_folder = {f"runs/{run.folder.name}": run.case for run in runs}
    scores = set()
    for row, of_json in zip(rows, situation["runs"], strict=True):
        case = by_folder[of_json["folder"]]
        arm = arm_of(case)
        (own,) = [run for run in runs if out / of_json["folder"] == run.folder]
        expected = outcome_of(own)
        penalty = "" if arm.penalty is None else str(arm.penalty)
        assert (row["method"], row["credit"], row["penalty"]) == (arm.method, arm.credit, penalty)
        assert (row["seed"], row["shared"]) == (str(case.seed), str(arm.shared))
        for name, value in vars(expected).items():
            assert float(row[name]) == of_json[name] == value
        scores.add((expected.score, expected.entropy_share))
    assert len(scores) == 18  # else runs could be taken for one another
    write_crossed(runs, out, "short")
    for name in names:
        assert (out / name).read_bytes() != before[name], name
    text = (out / "crossed.md").read_text()
    assert "smoke" not in text
    assert "Not in any" not in text
