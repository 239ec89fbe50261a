"""On a file system without locks, trainings go on, and say so."""

import errno
import fcntl
import os
from collections.abc import Callable
from pathlib import Path

import pytest

from innerattn.config import RunConfig
from innerattn.config.files import sync_folder
from innerattn.errors import RunError
from innerattn.records.run_folder import read_info
from innerattn.train import Progress, resume, train
from innerattn.train.run_lock import only_training_in

Configure = Callable[..., RunConfig]


@pytest.fixture(params=[errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP, errno.EPERM])
def no_locks(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise OSError(request.param, os.strerror(request.param))

    monkeypatch.setattr(fcntl, "flock", refuse)


@pytest.mark.usefixtures("no_locks")
def test_a_training_begins_stops_and_goes_on(
    small_config: Configure, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    def stop(now: Progress) -> None:
        if now.env_steps >= 300:
            raise KeyboardInterrupt

    run = tmp_path / "run"
    with pytest.raises(KeyboardInterrupt):
        train(small_config(), run, progress=stop)
    assert "its file system has no locks" in caplog.text
    resume(run)
    assert read_info(run).state == "done"
    assert [path.name for path in tmp_path.iterdir()] == ["run"]


def test_other_errors_of_a_lock_are_not_taken_for_that(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        raise OSError(errno.EIO, os.strerror(errno.EIO))

    monkeypatch.setattr(fcntl, "flock", fail)
    with pytest.raises(RunError, match=r"cannot be locked"), only_training_in(tmp_path):
        pass


def test_a_folder_that_cannot_be_locked_is_none(
    small_config: Configure, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        raise OSError(errno.EIO, os.strerror(errno.EIO))

    monkeypatch.setattr(fcntl, "flock", fail)
    with pytest.raises(RunError, match=r"cannot make the run folder \(Input/output error\)"):
        train(small_config(), tmp_path / "run")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("number", [errno.EINVAL, errno.ENOTSUP, errno.ENOSYS, errno.EBADF])
def test_a_folder_that_cannot_be_synced_is_left(
    number: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(_: int) -> None:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(os, "fsync", refuse)
    sync_folder(tmp_path)
