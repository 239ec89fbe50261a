"""Groups under faults are measured once, as the command does it, and then only read."""

from dataclasses import replace
from pathlib import Path

import pytest
from small_study import run_in

from innerattn.cli.main import main
from innerattn.errors import RunError
from innerattn.experiments.plan import Case
from innerattn.experiments.robustness import design, measurement
from innerattn.experiments.robustness.measurement import FaultMeasurement, missing_measurements
from innerattn.experiments.robustness.results import over_groups, read_measurements
from innerattn.experiments.run import FinishedRun, read_run
from innerattn.policies import Policy


@pytest.fixture
def runs(study: Path, monkeypatch: pytest.MonkeyPatch) -> list[FinishedRun]:
    """The finished runs in a pool, which are to meet one fault in few worlds."""

    def few(cases: list[design.Case]) -> list[design.Group]:
        return [replace(one, kinds=("blackout",), episodes=3) for one in design.groups(cases)]

    monkeypatch.setattr(measurement, "groups", few)
    return [
        read_run(Case("mixed", method, 0), run_in(study, method))
        for method in ("td-inner", "td-uniform")
    ]


def missing(runs: list[FinishedRun], study: Path) -> list[FaultMeasurement]:
    return missing_measurements([run.case for run in runs], runs, study)


def measured(runs: list[FinishedRun], study: Path) -> FaultMeasurement:
    """The only measurement that there is, done."""
    (job,) = missing(runs, study)
    shares: list[float] = []
    job.do(shares.append)
    assert shares[0] == 0.0
    assert shares == sorted(shares)
    assert 0.0 < shares[-1] <= 1.0
    return job


@pytest.mark.long
def test_a_document_is_that_of_the_command_and_is_read_without_playing(
    study: Path,
    runs: list[FinishedRun],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    job = measured(runs, study)
    assert str(job) == "faults of mixed-s0"
    folders = [str(one.folder) for one in runs]
    few = ["--faults", "blackout", "--episodes", "3"]
    assert main(["robustness", *folders, *few, "--json", "-"]) == 0
    assert job.path.read_text() == capsys.readouterr().out

    def refuse(*_: object) -> Policy:
        raise AssertionError("a policy was loaded")

    monkeypatch.setattr("innerattn.evaluate.robustness.load_trained", refuse)
    assert missing(runs, study) == []
    (deployment,) = over_groups(read_measurements(runs, study), ()).deployments
    methods = [one.method for one in runs]
    names = [one.name for one in deployment.policies]
    assert names == [*methods, "greedy", "hungarian", "oracle"]
    assert list(deployment.attention) == methods[:1]
    assert deployment.bounds is not None
    assert (deployment.bounds.critics, deployment.bounds.runs) == (1, 2)


def test_other_weights_are_another_measurement(study: Path, runs: list[FinishedRun]) -> None:
    (job,) = missing(runs, study)
    job.path.parent.mkdir()
    job.path.write_text("{}")  # only its name counts
    assert missing(runs, study) == []
    runs[1] = replace(runs[1], info=replace(runs[1].info, weights_sha256=64 * "0"))
    assert len(missing(runs, study)) == 1
    assert read_measurements(runs, study) == []


def test_a_group_waits_for_all_its_runs(study: Path, runs: list[FinishedRun]) -> None:
    assert missing_measurements([run.case for run in runs], runs[:1], study) == []


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"policies": [{}], "robots": []}'])
def test_a_damaged_document_is_named(text: str, study: Path, runs: list[FinishedRun]) -> None:
    (job,) = missing(runs, study)
    job.path.parent.mkdir()
    job.path.write_text(text)
    with pytest.raises(RunError, match=f"{job.path.name}: not a measurement under faults of this"):
        read_measurements(runs, study)
