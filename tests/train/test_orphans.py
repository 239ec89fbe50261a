"""What a killed process left of a run folder goes at the next start, and nothing else does."""

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from innerattn.config import RunConfig
from innerattn.train import RunFolder
from innerattn.train.orphans import being_made, sweep_orphans

Configure = Callable[..., RunConfig]

CHILD = """
import sys, time
from pathlib import Path
from innerattn.config import load_run_config
from innerattn.train import RunFolder, checkpoint

def stay(*_):
    print("in the middle", flush=True)
    time.sleep(600)

if sys.argv[2] == "first":
    checkpoint.write_toml = stay
else:
    checkpoint.os.rename = stay
RunFolder.create(Path(sys.argv[1]), load_run_config(), threads=1)
"""


@contextmanager
def making(path: Path, where: str) -> Iterator[subprocess.Popen[str]]:
    """A process that stays in the middle of making a run folder."""
    command = [sys.executable, "-c", CHILD, str(path), where]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            assert process.stdout.readline() == "in the middle\n"
            yield process
        finally:
            process.kill()


def names(folder: Path) -> list[str]:
    return sorted(entry.name for entry in folder.iterdir())


@pytest.mark.long
@pytest.mark.parametrize("where", ["first", "last"])
def test_what_a_killed_process_made_is_swept_at_the_next_start(
    small_config: Configure, tmp_path: Path, where: str
) -> None:
    with making(tmp_path / "run", where) as process:
        partial = f".run.{process.pid}"
        assert names(tmp_path) == [partial]
        RunFolder.create(tmp_path / "beside", small_config(), threads=1)
        assert names(tmp_path) == [partial, "beside"]  # it lives
        process.send_signal(signal.SIGKILL)
        process.wait()
        assert names(tmp_path) == [partial, "beside"]
    RunFolder.create(tmp_path / "run", small_config(), threads=1)
    assert names(tmp_path) == ["beside", "run"]


def dead_process() -> int:
    process = subprocess.Popen([sys.executable, "-c", ""])
    process.wait()
    return process.pid


def test_nothing_else_is_swept(tmp_path: Path) -> None:
    dead = dead_process()
    (tmp_path / f".orphan.{dead}").mkdir()
    (tmp_path / f".run.{dead}").mkdir()
    (tmp_path / f".run.{dead}" / "metrics.jsonl").touch()
    (tmp_path / f".notes.{dead}" / "checkpoints" / "24").mkdir(parents=True)
    (tmp_path / f".link.{dead}").symlink_to(tmp_path)
    (tmp_path / f".file.{dead}").touch()
    (tmp_path / f".mine.{os.getppid()}").mkdir()
    (tmp_path / f"run.{dead}").mkdir()
    before = names(tmp_path)
    sweep_orphans(tmp_path)
    assert sorted({*before} - {*names(tmp_path)}) == [f".orphan.{dead}"]


def test_a_folder_that_is_locked_is_of_a_living_process_elsewhere(tmp_path: Path) -> None:
    partial = tmp_path / f".run.{dead_process()}"  # a number that another machine gave
    with being_made(partial):
        sweep_orphans(tmp_path)
        assert partial.is_dir()
    sweep_orphans(tmp_path)
    assert not partial.exists()


def test_the_number_of_a_killed_process_may_come_again(
    small_config: Configure, tmp_path: Path
) -> None:
    (tmp_path / f".run.{os.getpid()}").mkdir()
    RunFolder.create(tmp_path / "run", small_config(), threads=1)
    assert names(tmp_path) == ["run"]


def test_what_is_there_by_that_name_is_not_removed_by_a_failure(
    small_config: Configure, tmp_path: Path
) -> None:
    mine = tmp_path / f".run.{os.getpid()}" / "mine"
    mine.mkdir(parents=True)
    with pytest.raises(Exception, match="cannot make the run folder"):
        RunFolder.create(tmp_path / "run", small_config(), threads=1)
    assert mine.is_dir()
