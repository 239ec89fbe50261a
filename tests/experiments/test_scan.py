"""What is found of planned runs: only what is whole and as planned is used."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from reseal import reseal

from innerattn.errors import RunError
from innerattn.experiments.failures import forget_failures, note_failure
from innerattn.experiments.plan import PlannedRun, plan
from innerattn.experiments.scan import RunStatus, finished_runs, scan_runs


@pytest.fixture
def planned(study: Path, small: dict[str, object]) -> list[PlannedRun]:
    return plan(("td-inner", "td-uniform"), ("mixed",), (0, 1), "quick", study, small)


def find(planned: list[PlannedRun], study: Path) -> RunStatus:
    """What becomes of the first run; the others are left as they are."""
    first, *others = scan_runs(planned, study)
    assert [one.state for one in others] == ["finished", "missing", "missing"]
    return first


def edit(path: Path, change: Callable[[dict[str, Any]], object]) -> None:
    document = json.loads(path.read_text())
    change(document)
    path.write_text(json.dumps(document))
    reseal(path.parent if path.name == "run.json" else path.parents[1])


def test_finished_and_missing(study: Path, planned: list[PlannedRun]) -> None:
    found = scan_runs(planned, study)
    assert [one.state for one in found] == ["finished", "finished", "missing", "missing"]
    runs = finished_runs(found)
    assert [run.case for run in runs] == [one.case for one in planned[:2]]
    assert runs[0].folder == study / "runs" / "mixed-td-inner-quick-s0"


@pytest.mark.parametrize("state", ["running", "interrupted"])
def test_a_run_that_did_not_end_is_unfinished(
    state: str, study: Path, planned: list[PlannedRun]
) -> None:
    edit(planned[0].folder / "run.json", lambda info: info.update(state=state))
    assert find(planned, study) == RunStatus(planned[0], "unfinished", f"its state is {state!r}")


@pytest.mark.parametrize("name", ["summary.json", "episodes.parquet", "rescues.parquet"])
def test_a_run_without_its_whole_evaluation_is_unmeasured(
    name: str, study: Path, planned: list[PlannedRun]
) -> None:
    file = planned[0].folder / "evaluation" / name
    file.write_bytes(file.read_bytes()[:-20])
    assert find(planned, study).state == "unmeasured"
    if file.suffix == ".parquet":
        whole = file.read_bytes()
        file.write_bytes(whole[:-40] + bytes(32) + whole[-8:])  # its end, spoilt
        assert find(planned, study).state == "unmeasured"
    file.unlink()
    assert find(planned, study).state == "unmeasured"
    note_failure(study, planned[0], "its disk was full")
    assert find(planned, study).state == "unmeasured"


def test_what_cannot_be_measured_again_is_left_alone(
    study: Path, planned: list[PlannedRun]
) -> None:
    folder = planned[0].folder
    shutil.rmtree(folder / "checkpoints")
    assert find(planned, study).state == "finished"
    (folder / "evaluation" / "summary.json").unlink()
    found = find(planned, study)
    assert (found.state, found.why) == (
        "unreadable",
        f"it has no weights to measure, and {folder / 'evaluation' / 'summary.json'}: missing",
    )


def test_an_evaluation_of_another_version_is_left_alone(
    study: Path, planned: list[PlannedRun]
) -> None:
    path = planned[0].folder / "evaluation" / "summary.json"
    path.write_text('{"schema_version": 2, "what comes then": []}')
    reseal(path.parents[1])
    found = find(planned, study)
    assert (found.state, found.why) == ("unreadable", f"{path}: schema_version = 2: must be 1")


def test_another_configuration_is_named_with_both_values(
    study: Path, planned: list[PlannedRun]
) -> None:
    file = planned[0].folder / "config.toml"
    file.write_text(file.read_text().replace("polyak = 0.02\n", "polyak = 0.03\n"))
    reseal(file.parent)
    expected = "td.polyak = 0.03, planned 0.02"
    assert find(planned, study) == RunStatus(planned[0], "other_configuration", expected)


def test_many_differences_are_cut_short(small: dict[str, object], study: Path) -> None:
    changes = {
        "td.gamma": 0.5,
        "td.polyak": 0.5,
        "td.reward_scale": 1.0,
        "network.precision": "bfloat16",
    }
    planned = plan(("td-inner",), ("mixed",), (0,), "quick", study, {**small, **changes})
    (found,) = scan_runs(planned, study)
    assert found.why == (
        "network.precision = 'float32', planned 'bfloat16'; td.gamma = 0.95, planned 0.5; "
        "td.polyak = 0.02, planned 0.5; and 1 more"
    )


def test_numbers_that_a_run_does_not_look_at_do_not_count(
    small: dict[str, object], study: Path
) -> None:
    inert = {"ppo.gamma": 0.5, "imitation.env_steps": 9}
    warm = {"imitation.env_steps": 300_000, "train.warm_start": "greedy"}
    for changes, state in ((inert, "finished"), (warm, "other_configuration")):
        planned = plan(("td-inner",), ("mixed",), (0,), "quick", study, {**small, **changes})
        (found,) = scan_runs(planned, study)
        assert found.state == state


def test_a_key_that_came_later_has_its_default(study: Path, planned: list[PlannedRun]) -> None:
    file = planned[0].folder / "config.toml"
    text = file.read_text()
    assert "polyak = 0.02\n" in text
    file.write_text(text.replace("polyak = 0.02\n", ""))
    reseal(file.parent)
    assert find(planned, study).state == "finished"


def test_a_linked_run_folder_is_followed_and_a_linked_file_is_not(
    study: Path, planned: list[PlannedRun], tmp_path: Path
) -> None:
    folder = planned[0].folder
    folder.rename(tmp_path / "elsewhere")
    folder.symlink_to(tmp_path / "elsewhere")
    assert find(planned, study).state == "finished"
    for name in (
        "run.json",
        "config.toml",
        "evaluation/summary.json",
        "evaluation/rescues.parquet",
    ):
        file = tmp_path / "elsewhere" / name
        file.rename(tmp_path / "file")
        file.symlink_to(tmp_path / "file")
        found = find(planned, study)
        assert (found.state, str(folder / name) in (found.why or "")) == ("unreadable", True)
        file.unlink()
        (tmp_path / "file").rename(file)


@pytest.mark.parametrize("name", ["run.json", "config.toml"])
def test_what_is_damaged_is_named(name: str, study: Path, planned: list[PlannedRun]) -> None:
    (planned[0].folder / name).write_text("?")
    found = find(planned, study)
    assert found.state == "unreadable"
    assert str(planned[0].folder / name) in (found.why or "")


def test_a_run_that_was_measured_otherwise_is_not_used(
    study: Path, planned: list[PlannedRun]
) -> None:
    edit(planned[0].folder / "evaluation" / "summary.json", lambda found: found.update(seed=5))
    found = find(planned, study)
    assert found.state == "unreadable"
    assert (found.why or "").endswith("seed = 5, its configuration says 12345")


def test_failures_are_known_until_they_are_forgotten(
    study: Path, planned: list[PlannedRun]
) -> None:
    for one in planned:
        note_failure(study, one, f"{one.case} diverged")
    found = scan_runs(planned, study)
    assert [one.state for one in found] == ["finished", "finished", "failed", "failed"]
    assert found[3].why == "mixed td-uniform seed 1 diverged"
    forget_failures(study, planned[1:3])
    found = scan_runs(planned, study)
    assert [one.state for one in found] == ["finished", "finished", "missing", "failed"]


def test_a_damaged_list_of_failures_is_one_line(study: Path, planned: list[PlannedRun]) -> None:
    (study / "failures.json").write_text("[]")
    with pytest.raises(RunError, match=r"failures\.json: not a list of failed runs; remove it$"):
        scan_runs(planned, study)
