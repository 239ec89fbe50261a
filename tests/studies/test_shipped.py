"""Shipped studies: what they plan, as `innerattn reproduce` narrows them."""

from itertools import product
from pathlib import Path

import pytest
from small_study import planned_of

from innerattn.cli.main import main
from innerattn.config import BUDGETS, RunConfig
from innerattn.errors import RunError
from innerattn.experiments.archive import read_archive
from innerattn.experiments.plan import METHODS, SITUATIONS, Case
from innerattn.report.targets import TARGETS
from innerattn.studies.plan import plan_study, run_digest
from innerattn.studies.shipped import FOLDER, as_file, narrowed, shipped_table
from innerattn.studies.study import study_in

RECORDS = Path(__file__).parents[2] / "docs" / "records"
FILES = sorted(one.name for one in FOLDER.iterdir() if one.name.endswith(".toml"))


@pytest.mark.parametrize("name", FILES)
def test_a_file_is_a_study_that_asks_something(name: str) -> None:
    study = study_in((FOLDER / name).read_bytes(), name)
    assert study.question
    assert plan_study(study, Path)
    assert any(name == f"{one.file or one.name}.toml" for one in TARGETS.values())


def test_all_runs_of_a_seed_come_first() -> None:
    cases = [one.case for one in planned_of("all", seeds=3, budget="quick")]
    assert len(set(cases)) == len(cases) == 3 * 3 * 4
    assert set(cases) == {Case(*case) for case in product(SITUATIONS, METHODS, range(3))}
    assert [case.seed for case in cases] == [0] * 12 + [1] * 12 + [2] * 12


@pytest.mark.parametrize("target", ["all", "crossed"])
def test_only_runs_of_one_seed_are_measured_in_the_same_worlds(target: str) -> None:
    planned = planned_of(target, ("td-inner", "td-uniform"), ("mixed",), 3)
    worlds = {(one.seed, one.config.evaluate.seed) for one in planned}
    assert worlds == {(0, 12_345), (1, 12_346), (2, 12_347)}


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
    *_, one = planned_of("all", (method,), (situation,), 4, budget)
    assert asked == [one.config]


@pytest.mark.parametrize(
    ("target", "budget", "archive", "seeds", "count"),
    [
        ("all", "short", "reproduction", 5, 60),
        ("crossed", "short", "crossed", 10, 180),
        ("swapped", "short", "swapped", 10, 40),
        ("learning-ablations", "fast", "fast", 3, 63),
        ("attention", "fast", "fast", 10, 115),
        ("learning-long", "strong", "strong", 5, 15),
        ("learning-afterstates", "strong", "strong", 5, 15),
    ],
)
def test_published_runs_are_those_that_are_planned(
    target: str, budget: str, archive: str, seeds: int, count: int
) -> None:
    published = {run_digest(run.config) for run in read_archive(RECORDS / f"{archive}.parquet")}
    planned = {one.digest for one in planned_of(target, seeds=seeds, budget=budget)}
    assert len(planned & published) == count


def test_other_seeds_and_budgets_are_those_of_grids_alike() -> None:
    table = narrowed(
        shipped_table("robustness"), methods=METHODS, scenarios=("mixed",), budget="fast", seeds=2
    )
    assert [(grid["budgets"], grid["seeds"]) for grid in table["grid"]] == [
        *([(["fast"], [0, 1])] * 3),
        (["quick"], [0]),
    ]
    study = study_in(as_file(table), "robustness.toml")
    assert study.digest() != study_in((FOLDER / "robustness.toml").read_bytes(), "x").digest()


def test_contrasts_of_what_is_left_out_are_left_out() -> None:
    def names(*methods: str) -> list[str]:
        table = narrowed(
            shipped_table("attention"),
            methods=methods,
            scenarios=("mixed",),
            budget="fast",
            seeds=1,
        )
        return [one["name"] for one in table["contrasts"]]

    assert names("ppo-inner", "mappo") == ["learnt attention beside no attention"]
    assert names("mappo", "ppo-frozen") == []


def test_a_run_has_the_same_name_whatever_its_device() -> None:
    def keys(device: str) -> list[str]:
        table = narrowed(
            shipped_table("learning"),
            methods=("mappo",),
            scenarios=("mixed",),
            budget="fast",
            seeds=2,
            device=device,
        )
        planned = plan_study(study_in(as_file(table), "learning.toml"), Path)
        assert {one.config.train.device for one in planned} == {device}
        return [one.key for one in planned]

    assert keys("cuda") == keys("cpu")
