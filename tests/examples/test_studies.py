"""The example studies are planned; those of the published pages are the runs that these are of."""

from pathlib import Path

import pytest

from innerattn.experiments.archive import read_archive
from innerattn.experiments.attention.study import read_attention
from innerattn.report.targets import TARGETS
from innerattn.studies.plan import plan_study
from innerattn.studies.results import Result, compare
from innerattn.studies.study import study_in

FOLDER = Path(__file__).parents[2] / "examples" / "studies"
FILES = sorted(FOLDER.glob("*.toml"))
ARCHIVE = Path(__file__).parents[2] / "docs" / "records" / "fast.parquet"
PUBLISHED = {"attention": "attention", "ablations": "learning-ablations"}


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_it_is_planned_and_asks_something(file: Path) -> None:
    study = study_in(file.read_bytes(), file)
    assert study.question
    assert study.contrasts
    assert plan_study(study, FOLDER.joinpath)


@pytest.mark.parametrize("name", PUBLISHED)
def test_its_runs_are_those_of_the_published_page(name: str) -> None:
    file = FOLDER / f"{name}.toml"
    study = study_in(file.read_bytes(), file)
    target = TARGETS[PUBLISHED[name]]
    planned = target.plan(
        target.methods, target.situations, study.grid.numbers, "fast", Path("studies/fast")
    )
    found = {run.digest for run in plan_study(study, FOLDER.joinpath)}
    assert found == {run.config.digest() for run in planned}


def test_rules_of_the_file_give_the_published_verdicts() -> None:
    """The published runs, judged by the study's file: the same numbers to the last digit."""
    file = FOLDER / "attention.toml"
    study = study_in(file.read_bytes(), file)
    planned = plan_study(study, FOLDER.joinpath)
    runs = {run.config.digest(): run for run in read_archive(ARCHIVE)}
    results = [Result(run, runs[run.digest].summary) for run in planned if run.digest in runs]
    assert len(results) > 100
    found = {
        (one.a["scenario"], one.b["method"]): (
            one.seeds,
            one.found and one.found.difference,
            one.found and one.found.equivalent,
        )
        for one in compare(study, planned, results)
        if one.found is not None
    }
    published = read_attention([runs[one.run.digest] for one in results]).comparisons
    assert found == {
        (one.situation, one.other): (
            one.seeds,
            one.difference and one.difference.difference,
            one.difference and one.difference.equivalent,
        )
        for one in published
    }
    judged = {
        (one.a["scenario"], one.b["method"]): (one.holm_p, one.verdict)
        for one in compare(study, planned, results)
        if one.holm_p is not None
    }
    words = {"better": "greater", "worse": "smaller"}
    assert judged == {
        (one.situation, one.other): (one.holm_p, words.get(one.verdict, one.verdict))
        for one in published
    }
