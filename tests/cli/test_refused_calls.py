"""File systems that refuse a call: studies, `seal` and live pages do without it."""

import errno
import fcntl
import json
import os
import shutil
import stat
from collections.abc import Callable
from pathlib import Path

import pytest
from tiny_study import TINY

from innerattn.cli.main import main
from innerattn.cli.watch import Watch
from innerattn.records.run_files import MANIFEST
from innerattn.report.watch.study import study_pages
from innerattn.studies.folder import begin_study
from innerattn.studies.work import work


@pytest.fixture(
    params=[
        ("flock", errno.ENOLCK),
        ("link", errno.EPERM),
        ("link", errno.EOPNOTSUPP),
        ("fsync", errno.EINVAL),
        ("statvfs", errno.ENOSYS),
    ],
    ids=lambda one: f"{one[0]}-{errno.errorcode[one[1]]}",
)
def asked(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Refuses a call, of fsync that of folders; the calls that were refused."""
    name, number = request.param
    module = fcntl if name == "flock" else os
    real: Callable[..., object] = getattr(module, name)
    refused: list[str] = []

    def refuse(*words: object, **options: object) -> object:
        if name == "fsync" and not stat.S_ISDIR(os.fstat(int(str(words[0]))).st_mode):
            return real(*words, **options)
        refused.append(name)
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(module, name, refuse)
    return [name] if name == "statvfs" else refused


@pytest.mark.long
def test_a_study_is_worked_and_watched(asked: list[str], tmp_path: Path) -> None:
    file = tmp_path / "tiny.toml"
    file.write_text(TINY.replace('"0..2"', "[0]"))
    study = begin_study(file, tmp_path / "study")
    work(study.ledger(), study.to_do)
    assert set(study.states().values()) == {"done"}
    assert list((study.path / "work").iterdir()) == []
    state = json.loads(study_pages(study)["state"]().text)
    assert (state["counts"]["done"], len(state["rows"])) == (2, 2)
    assert main(["study", "report", str(study.path), "-q"]) == 0
    assert (study.path / "report.md").exists()
    assert asked


def test_a_run_is_sealed_and_watched(asked: list[str], run_dir: Path, tmp_path: Path) -> None:
    run = Path(shutil.copytree(run_dir, tmp_path / "run"))
    (run / MANIFEST).unlink()
    assert main(["seal", str(run)]) == 0
    assert (run / MANIFEST).exists()
    pages = Watch(runs=[str(run)], episodes=1)._pages()
    (row,) = json.loads(pages["state"]().text)["runs"]
    assert row["state"] == "done"
    assert "after 400 env-steps" in pages["episodes/0"]().text
    del asked
