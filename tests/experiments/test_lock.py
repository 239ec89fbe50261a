"""One study at a time in a folder, to the end of the last process that it started."""

import multiprocessing
import signal
from pathlib import Path

import pytest

from innerattn.errors import RunError
from innerattn.experiments.lock import StudyLock


def test_a_second_one_is_refused(tmp_path: Path) -> None:
    out = tmp_path / "new" / "study"
    with (
        StudyLock.take(out),
        pytest.raises(RunError, match=r"study: another study is at work here, .*"),
    ):
        StudyLock.take(out)
    with StudyLock.take(out):
        pass


def test_a_process_holds_it_to_its_end(tmp_path: Path) -> None:
    process = multiprocessing.get_context("spawn").Process(target=signal.pause)
    with StudyLock.take(tmp_path) as lock:
        process.keep = lock  # type: ignore[attr-defined]
        process.start()
    with pytest.raises(RunError, match="its last runs are still ending"):
        StudyLock.take(tmp_path)
    process.kill()
    process.join()
    with StudyLock.take(tmp_path):
        pass


def test_a_file_cannot_hold_a_study(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(RunError, match=r"file: cannot hold a study \(File exists\)$"):
        StudyLock.take(tmp_path / "file")
