"""What `innerattn robustness` says in words, the letters of runs, and what "-" means."""

import io
import math

import pytest
from rich.console import Console

from innerattn.config import Scenario
from innerattn.evaluate.faults.overview import KindOverview, Overview
from innerattn.report.table import Table, plain_table, print_table
from innerattn.report.table import columns as heads
from innerattn.report.tables import robustness
from innerattn.report.tables.robustness import run_letters, verdict
from innerattn.stats import Estimate

MIXED = Scenario.preset("mixed")


def kind(name: str, retention: float, robot: str = "food_0") -> KindOverview:
    kept = Estimate(retention, retention - 0.02, retention + 0.02)
    return KindOverview(
        kind=name,
        rescues=kept,
        retention=kept,
        by_severity=(retention,),
        worst_robot=robot,
        worst=kept,
        early=kept,
        late=kept,
        change=kept,
    )


def policy(retention: float, *kinds: KindOverview) -> Overview:
    kept = Estimate(retention, retention - 0.01, retention + 0.01)
    both = kinds or (kind("motor_gain", retention), kind("blackout", 0.5))
    return Overview(rescues=kept, rescues_with_fault=kept, kinds=both, retention=kept)


NOBODY = policy(math.nan, kind("motor_gain", math.nan))
SCRIPT = {"hungarian": policy(0.9)}


def lines(runs: dict[str, Overview]) -> list[str]:
    found = {**runs, **SCRIPT}
    return verdict(MIXED, found, run_letters(found))


def test_it_opens_with_the_robot_whose_loss_costs_most_and_why() -> None:
    lost = kind("unavailable", 0.18, "medical_0")
    (first, *_) = lines({"mine": policy(0.75, kind("blackout", 0.1, "food_1"), lost)})
    assert first == (
        "Without medical_0 the team keeps 18 % of its rescues: nobody else offers medicine."
    )
    (first, *_) = lines({"mine": policy(0.75, kind("unavailable", 0.6, "food_1"))})
    assert first == "Without food_1 the team keeps 60 % of its rescues."  # food_0 offers food too


def test_without_the_loss_of_a_robot_it_opens_with_the_worst_fault() -> None:
    kinds = kind("motor_gain", 0.3, "navigation_0"), kind("heading_bias", 0.5)
    (first, *_) = lines({"mine": policy(0.75, *kinds)})
    assert first == (
        "With the worst motor gain of navigation_0 the team keeps 30 % of its rescues: "
        "nobody else offers information."
    )


def test_one_run_and_two() -> None:
    one = {"mine": policy(0.75)}
    assert lines(one) == [
        "With the worst blackout of food_0 the team keeps 50 % of its rescues.",
        "Share of rescues kept when a robot fails: A 0.75 ± 0.01, hungarian 0.90 ± 0.01",
        "Fault that costs most: A blackout 0.50 ± 0.02",
    ]
    two = lines({**one, "other": policy(0.25)})
    assert two == [
        "With the worst blackout of food_0 A keeps 50 % of its rescues.",
        "With the worst motor gain of food_0 B keeps 25 % of its rescues.",
        "Share of rescues kept when a robot fails: A 0.75 ± 0.01, B 0.25 ± 0.01, "
        "hungarian 0.90 ± 0.01",
        "Fault that costs most: A blackout 0.50 ± 0.02, B motor gain 0.25 ± 0.02",
    ]


def test_many_runs_share_a_line() -> None:
    runs = {f"run-{seed}": policy(seed / 10) for seed in range(1, 5)}
    runs["nobody"] = NOBODY
    *words, first, second = lines(runs)
    assert len(words) == 2
    assert first == (
        "Share of rescues kept when a robot fails: 5 runs 0.10 to 0.40, hungarian 0.90 ± 0.01"
    )
    assert second == "Fault that costs most: A motor gain 0.10 ± 0.02, B motor gain 0.20 ± 0.02"


def test_runs_that_rescue_nobody() -> None:
    assert lines({"nobody": NOBODY}) == [
        "The team rescues nobody, so it cannot lose rescues.",
        "Share of rescues kept when a robot fails: A -, hungarian 0.90 ± 0.01",
        "Fault that costs most: unknown, since the runs rescue nobody",
    ]


@pytest.mark.parametrize(("cell", "said"), [("0.50 ± 0.02", False), ("-", True), ("a -", True)])
def test_a_dash_is_explained_where_there_is_one(cell: str, said: bool) -> None:
    table: Table = plain_table(heads(["retention"], ["A"]), [["blackout", cell]], "title", ("a",))
    shown = io.StringIO()
    print_table(Console(file=shown, width=80), robustness._explained(table))
    assert ("-: too few rescues without a fault" in shown.getvalue()) is said


def test_letters() -> None:
    letters = run_letters({**dict.fromkeys(map(str, range(28))), "greedy": None, "oracle": None})
    assert [letters["0"], letters["25"], letters["26"], letters["27"]] == ["A", "Z", "A2", "B2"]
    assert len(set(letters.values())) == len(letters) == 28
