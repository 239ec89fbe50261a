"""A study that was stopped goes on with the runs that it was training."""

import shutil
from pathlib import Path

import pytest

from innerattn.experiments.lock import StudyLock
from innerattn.experiments.plan import PlannedRun, plan
from innerattn.experiments.scan import scan_runs
from innerattn.experiments.train import train_missing
from innerattn.records.run_folder import read_info
from innerattn.train import Progress, train

METHODS = ("td-inner", "td-uniform")


def stopped(one: PlannedRun) -> Path:
    """The folder of a run that was stopped after half of its steps."""

    def stop(progress: Progress) -> None:
        if progress.env_steps >= progress.total_env_steps / 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train(one.config, one.folder, progress=stop)
    return one.folder


@pytest.mark.usefixtures("in_this_process")
@pytest.mark.parametrize("damaged", [False, True])
def test_a_run_that_was_stopped_goes_on(
    tmp_path: Path, finished_study: Path, small: dict[str, object], damaged: bool
) -> None:
    planned = plan(METHODS, ("mixed",), (0,), "quick", tmp_path, small)
    done, left = planned
    shutil.copytree(finished_study / "runs" / done.folder.name, done.folder)
    stopped(left)
    if damaged:
        weights = left.folder / "checkpoints" / "48" / "weights.safetensors"
        data = bytearray(weights.read_bytes())
        data[-1] ^= 1
        weights.write_bytes(data)
    found = scan_runs(planned, tmp_path)
    assert [one.state for one in found] == ["finished", "unfinished"]
    with StudyLock.take(tmp_path) as lock:
        train_missing(
            found,
            tmp_path,
            lock,
            changed=lambda _: None,
            failed=lambda one, why: pytest.fail(f"{one}: {why}"),
        )
    assert [one.state for one in scan_runs(planned, tmp_path)] == ["finished", "finished"]
    info, undisturbed = (
        read_info(folder / "runs" / left.folder.name) for folder in (tmp_path, finished_study)
    )
    assert info.resumed == (0 if damaged else 1)  # what cannot be read is begun anew
    assert info.weights_sha256 == undisturbed.weights_sha256
