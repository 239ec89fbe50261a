"""Groups under faults are measured once, as the command does it, and then only read."""

import json
from dataclasses import replace
from pathlib import Path

import pytest
from reseal import reseal

from innerattn.cli.main import main
from innerattn.errors import RunError
from innerattn.experiments.plan import PlannedRun, plan
from innerattn.experiments.robustness import design, measurement
from innerattn.experiments.robustness.measurement import (
    FaultMeasurement,
    missing_measurements,
    read_measurements,
)
from innerattn.experiments.scan import finished_runs, scan_runs
from innerattn.policies import Policy


@pytest.fixture
def planned(
    study: Path, small: dict[str, object], monkeypatch: pytest.MonkeyPatch
) -> list[PlannedRun]:
    """The finished runs of the study, which are to meet one fault in few worlds."""

    def few(cases: list[design.Case]) -> list[design.Group]:
        return [replace(one, kinds=("blackout",), episodes=3) for one in design.groups(cases)]

    monkeypatch.setattr(measurement, "groups", few)
    return plan(("td-inner", "td-uniform"), ("mixed",), (0,), "quick", study, small)


def measured(planned: list[PlannedRun], study: Path) -> FaultMeasurement:
    """The only measurement that there is, done."""
    (job,) = missing_measurements(scan_runs(planned, study), study)
    shares: list[float] = []
    job.do(shares.append)
    assert shares[0] == 0.0
    assert shares == sorted(shares)
    assert 0.0 < shares[-1] <= 1.0
    return job


def test_a_document_is_that_of_the_command_and_is_read_without_playing(
    study: Path,
    planned: list[PlannedRun],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    job = measured(planned, study)
    assert str(job) == "faults of mixed-s0"
    folders = [str(one.folder) for one in planned]
    few = ["--faults", "blackout", "--episodes", "3"]
    assert main(["robustness", *folders, *few, "--json", "-"]) == 0
    assert job.path.read_text() == capsys.readouterr().out

    def refuse(*_: object) -> Policy:
        raise AssertionError("a policy was loaded")

    monkeypatch.setattr("innerattn.evaluate.robustness.load_trained", refuse)
    found = scan_runs(planned, study)
    assert missing_measurements(found, study) == []
    (result,) = read_measurements(finished_runs(found), study)
    assert list(result.runs) == [one.case for one in planned]
    assert list(result.scripts) == ["greedy", "hungarian", "oracle"]
    assert list(result.bounds) == list(result.attention) == [planned[0].case]
    assert result.critics == 2


def test_other_weights_are_another_measurement(study: Path, planned: list[PlannedRun]) -> None:
    measured(planned, study)
    path = planned[1].folder / "run.json"
    info = json.loads(path.read_text())
    path.write_text(json.dumps({**info, "weights_sha256": 64 * "0"}))
    reseal(path.parent)
    found = scan_runs(planned, study)
    assert len(missing_measurements(found, study)) == 1
    assert read_measurements(finished_runs(found), study) == []


def test_a_group_waits_for_all_its_runs(study: Path, planned: list[PlannedRun]) -> None:
    (planned[1].folder / "evaluation" / "summary.json").unlink()
    assert missing_measurements(scan_runs(planned, study), study) == []


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"policies": [{}], "robots": []}'])
def test_a_damaged_document_is_named(text: str, study: Path, planned: list[PlannedRun]) -> None:
    found = scan_runs(planned, study)
    (job,) = missing_measurements(found, study)
    job.path.parent.mkdir()
    job.path.write_text(text)
    with pytest.raises(RunError, match=f"{job.path.name}: not a measurement under faults of this"):
        read_measurements(finished_runs(found), study)
