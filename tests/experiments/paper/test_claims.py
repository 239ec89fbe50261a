"""The rules that decide claims, on figures made for them."""

from dataclasses import replace

import numpy as np
import pytest

from innerattn.experiments.paper.claims import (
    EVEN_WITH,
    MORE_EVEN,
    UNEVEN_WITHOUT,
    Holds,
    entropy_claims,
    handoff_is_own,
    handoff_moves,
)
from innerattn.experiments.paper.competence import Competence, competence_units
from innerattn.experiments.paper.fig4 import EntropyCourse
from innerattn.experiments.paper.fig5 import Evidence, evidence
from innerattn.experiments.paper.pairs import pairs
from innerattn.experiments.paper.sharing_claims import judged, sharing_claims
from innerattn.experiments.paper.table2 import Row, Sharing, Table2
from innerattn.experiments.run import FinishedRun
from innerattn.measures.sharing.evenness import evenness, evenness_of_runs
from innerattn.stats import Estimate
from innerattn.stats.seeds import seed_estimate

EVEN, UNEVEN = (0.5, 0.51, 0.49), (0.8, 0.82, 0.79)


def made_row(method: str, task: str, shares: tuple[float, ...]) -> Row:
    rng = np.random.default_rng(0)
    runs = []
    for share in shares:
        first = rng.permutation(np.arange(1000) < round(1000 * share))
        runs.append(np.stack([first, ~first], 1).astype(np.int64))
    together = evenness_of_runs(runs, 0) if len(runs) > 1 else None
    sharing = Sharing(1000, tuple(evenness(run) for run in runs), together)
    seeds = tuple(range(len(shares)))
    return Row("mixed", method, seeds, task, ("food_0", "food_1"), sharing, sharing, None)


def made_competence(method: str, imbalance: list[float]) -> Competence:
    each = tuple(
        dict.fromkeys(competence_units(), 0.5) | {"imbalance": value} for value in imbalance
    )
    nothing: dict[str, Estimate | None] = dict.fromkeys(competence_units())
    seeds = tuple(range(len(each)))
    return Competence("mixed", method, seeds, ({},) * len(each), each, nothing)


def claims_of(**shares: list[tuple[float, ...]]) -> dict[tuple[str, str], Holds]:
    rows, beside = [], []
    for name, tasks in shares.items():
        method = name.replace("_", "-")
        rows += [made_row(method, f"task_{index}", task) for index, task in enumerate(tasks, 1)]
        beside.append(made_competence(method, np.abs(np.array(tasks) - 0.5).mean(0).tolist()))
    found = sharing_claims(Table2(tuple(rows), tuple(beside), tuple(pairs(beside)), (), ()))
    return {(claim.claim, claim.method): claim.holds for claim in found}


def test_a_task_is_judged_by_its_runs_and_not_by_their_mean_alone() -> None:
    assert judged(made_row("td-inner", "task_1", EVEN)) == "even"
    assert judged(made_row("td-inner", "task_1", UNEVEN)) == "uneven"
    assert judged(made_row("td-inner", "task_1", (0.9, 0.1, 0.88, 0.12))) == "uneven"
    assert judged(made_row("td-inner", "task_1", (0.5, 0.51, 0.7, 0.5))) == "undecided"
    assert judged(made_row("td-inner", "task_1", (0.5,))) == "undecided"


def test_a_run_without_rescues_leaves_a_task_undecided() -> None:
    row = made_row("td-inner", "task_1", EVEN)
    nothing = evenness(np.zeros((1000, 2), np.int64))
    each = (*row.scored.each, nothing)
    assert judged(replace(row, scored=replace(row.scored, each=each))) == "undecided"


def test_claims_about_sharing() -> None:
    found = claims_of(
        td_inner=[EVEN, EVEN], td_uniform=[UNEVEN, UNEVEN], ppo_inner=[EVEN, UNEVEN], mappo=[EVEN]
    )
    assert found == {
        (EVEN_WITH, "td-inner"): "yes",
        (MORE_EVEN, "td-inner"): "yes",
        (UNEVEN_WITHOUT, "td-uniform"): "yes",
        (EVEN_WITH, "ppo-inner"): "no",
    }
    found = claims_of(td_inner=[EVEN, EVEN], td_uniform=[EVEN, UNEVEN])
    assert found[UNEVEN_WITHOUT, "td-uniform"] == "no"
    found = claims_of(td_inner=[EVEN, EVEN], td_uniform=[(0.52, 0.5, 0.48), (0.5, 0.49, 0.51)])
    assert found[MORE_EVEN, "td-inner"] == "no"
    found = claims_of(td_inner=[(0.5,), (0.5,)], td_uniform=[(0.8,), (0.8,)])
    assert set(found.values()) == {"undecided"}


@pytest.mark.parametrize(
    ("begin", "end", "below", "falls"),
    [
        ((1.0, 1.01, 0.99), (0.5, 0.51, 0.49), "yes", "yes"),
        ((0.5, 0.51, 0.49), (0.8, 0.81, 0.79), "yes", "no"),
        ((1.095, 1.096, 1.094), (1.09, 1.0901, 1.0899), "no", "no"),  # less than even, hardly
        ((1.0, 1.01, 0.99), (0.97, 1.0, 0.93), "yes", "undecided"),
        ((0.8, 1.0, 0.9), (0.7, 1.05, 0.95), "undecided", "undecided"),
        ((1.0,), (0.5,), "undecided", "undecided"),
    ],
)
def test_claims_about_entropy(
    begin: tuple[float, ...], end: tuple[float, ...], below: Holds, falls: Holds
) -> None:
    means = [seed_estimate(values) for values in (begin, end, np.subtract(end, begin).tolist())]
    first, last, change = (mean for mean in means if mean is not None)
    course = EntropyCourse(
        situation="mixed",
        method="td-inner",
        seeds=tuple(range(len(end))),
        robots=("a", "b", "c", "d"),
        kinds=("k", "k", "l", "m"),
        env_steps=np.array([1]),
        nats=np.reshape(end, (-1, 1, 1, 1)),
        begin=first,
        end=last,
        change=change,
    )
    assert [claim.holds for claim in entropy_claims([course])] == [below, falls]


@pytest.fixture(scope="module")
def found(runs: list[FinishedRun]) -> Evidence:
    found = evidence([runs[0]])
    assert found is not None
    return found


@pytest.mark.parametrize(
    ("change", "moves"),
    [
        (Estimate(0.2, 0.1, 0.3, 3), "yes"),
        (Estimate(0.03, 0.01, 0.045, 3), "no"),
        (Estimate(-0.03, -0.1, 0.04, 3), "no"),
        (Estimate(0.1, -0.1, 0.3, 3), "undecided"),
        (Estimate(0.2, runs=1), "undecided"),
        (None, "undecided"),
    ],
)
def test_whether_attention_moves(change: Estimate | None, moves: Holds) -> None:
    assert handoff_moves(change) == moves


@pytest.mark.parametrize(
    ("change", "own", "holds"),
    [
        ((0.2, 0.22, 0.18), (0.15, 0.14, 0.16), "yes"),
        ((0.2, 0.22, 0.18), (0.0, 0.01, -0.01), "no"),
        ((0.2, 0.22, 0.18), (0.05, 0.06, 0.04), "no"),
        ((0.2, 0.22, 0.18), (0.09, 0.02, 0.16), "undecided"),
        ((0.1, 0.2, 0.3), (0.06, 0.07, 0.08), "undecided"),  # half the change is not known either
        ((0.2,), (0.15,), "undecided"),
    ],
)
def test_whether_the_move_is_that_of_who_hands_over(
    found: Evidence, change: tuple[float, ...], own: tuple[float, ...], holds: Holds
) -> None:
    beyond_half = seed_estimate(np.subtract(own, np.divide(change, 2.0)).tolist())
    made = replace(found, own_part=seed_estimate(own), own_part_beyond_half=beyond_half)
    assert handoff_is_own(made) == holds
