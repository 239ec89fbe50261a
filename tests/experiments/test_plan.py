"""Which runs a study needs: all of them, seed by seed, and the same as `innerattn train` makes."""

from collections.abc import Callable
from itertools import product
from pathlib import Path
from typing import Any

import pytest

from innerattn.cli.main import main
from innerattn.config import BUDGETS, RunConfig
from innerattn.errors import ConfigError, RunError
from innerattn.experiments.crossed.arms import plan_crossed
from innerattn.experiments.plan import METHODS, SITUATIONS, Case, PlannedRun, plan

OUT = Path("study")


def test_all_runs_of_a_seed_come_first() -> None:
    planned = plan(METHODS, SITUATIONS, range(3), "quick", OUT)
    cases = [one.case for one in planned]
    assert len(set(cases)) == len(cases) == 3 * 3 * 4
    assert set(cases) == {Case(*case) for case in product(SITUATIONS, METHODS, range(3))}
    assert [case.seed for case in cases] == [0] * 12 + [1] * 12 + [2] * 12
    assert [(case.situation, case.method) for case in cases[12:24]] == [
        (case.situation, case.method) for case in cases[:12]
    ]


def test_a_run_is_what_its_name_says() -> None:
    for one in plan(METHODS, SITUATIONS, (0, 7), "short", OUT):
        case, config = one.case, one.config
        assert config.scenario.situation == case.situation
        assert (config.train.method, config.train.seed) == (case.method, case.seed)
        assert config.train.threads == 1
        assert one.folder == OUT / "runs" / f"{case.situation}-{case.method}-short-s{case.seed}"


@pytest.mark.parametrize("make", [plan, plan_crossed])
def test_only_runs_of_one_seed_are_measured_in_the_same_worlds(make: Callable[..., Any]) -> None:
    planned: list[PlannedRun] = make(
        ("td-inner", "td-uniform"), ("mixed",), (0, 1, 5), "short", OUT
    )
    worlds = {(one.case.seed, one.config.evaluate.seed) for one in planned}
    assert worlds == {(0, 12_345), (1, 12_346), (5, 12_350)}


@pytest.mark.parametrize(
    ("budget", "situation", "method"),
    [*zip(BUDGETS, SITUATIONS, METHODS, strict=False), ("paper", "mixed", "ppo-uniform")],
)
def test_the_command_for_one_run_trains_the_same(
    budget: str, situation: str, method: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[RunConfig] = []

    def note(config: RunConfig, *_: object, **__: object) -> None:
        asked.append(config)
        raise RunError("not done")

    monkeypatch.setattr("innerattn.train.train", note)
    options = ["--preset", situation, "--method", method, "--budget", budget]
    options += ["--seed", "3", "--train.threads", "1", "--evaluate.seed", "12348"]
    assert main(["train", *options]) == 1
    (one,) = plan((method,), (situation,), (3,), budget, OUT)
    assert asked == [one.config]


def test_unknown_names_are_refused() -> None:
    with pytest.raises(ConfigError, match="'triple': known are double, mixed, "):
        plan(METHODS, ("triple",), (0,), "quick", OUT)
    with pytest.raises(ConfigError, match="'long': known are fast, paper, quick, short, strong"):
        plan(METHODS, SITUATIONS, (0,), "long", OUT)
