"""The two lines that `innerattn robustness` opens with, and the letters that stand for runs."""

import math

from innerattn.evaluate.faults.overview import KindOverview, Overview
from innerattn.report.tables.robustness import run_letters, verdict
from innerattn.stats import Estimate


def kind(name: str, retention: float) -> KindOverview:
    kept = Estimate(retention, retention - 0.02, retention + 0.02)
    return KindOverview(
        kind=name,
        rescues=kept,
        retention=kept,
        by_severity=(retention,),
        worst_robot="food_0",
        worst=kept,
        early=kept,
        late=kept,
        change=kept,
    )


def policy(retention: float, blackout: float) -> Overview:
    kept = Estimate(retention, retention - 0.01, retention + 0.01)
    kinds = (kind("motor_gain", retention), kind("blackout", blackout))
    return Overview(rescues=kept, rescues_with_fault=kept, kinds=kinds, retention=kept)


SCRIPT = {"hungarian": policy(0.9, 0.8)}


def lines(runs: dict[str, Overview]) -> tuple[str, str]:
    found = {**runs, **SCRIPT}
    return verdict(found, run_letters(found))


def test_one_run_and_two() -> None:
    one = {"mine": policy(0.75, 0.5)}
    assert lines(one) == (
        "Share of rescues kept when a robot fails: A 0.75 ± 0.01, hungarian 0.90 ± 0.01",
        "Fault that costs most: A blackout 0.50 ± 0.02",
    )
    two = lines({**one, "other": policy(0.25, 0.7)})
    assert two == (
        "Share of rescues kept when a robot fails: A 0.75 ± 0.01, B 0.25 ± 0.01, "
        "hungarian 0.90 ± 0.01",
        "Fault that costs most: A blackout 0.50 ± 0.02, B motor gain 0.25 ± 0.02",
    )


def test_many_runs_share_a_line() -> None:
    runs = {f"run-{seed}": policy(seed / 10, 0.5) for seed in range(1, 5)}
    runs["nobody"] = policy(math.nan, math.nan)
    first, second = lines(runs)
    assert first == (
        "Share of rescues kept when a robot fails: 5 runs 0.10 to 0.40, hungarian 0.90 ± 0.01"
    )
    assert second == "Fault that costs most: A motor gain 0.10 ± 0.02, B motor gain 0.20 ± 0.02"


def test_runs_that_rescue_nobody() -> None:
    assert lines({"nobody": policy(math.nan, math.nan)}) == (
        "Share of rescues kept when a robot fails: A -, hungarian 0.90 ± 0.01",
        "Fault that costs most: unknown, since the runs rescue nobody",
    )


def test_letters() -> None:
    letters = run_letters({**dict.fromkeys(map(str, range(28))), "greedy": None, "oracle": None})
    assert [letters["0"], letters["25"], letters["26"], letters["27"]] == ["A", "Z", "A2", "B2"]
    assert len(set(letters.values())) == len(letters) == 28
