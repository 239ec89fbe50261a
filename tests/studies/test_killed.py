"""Studies whose workers are killed, on this machine and on a Ray cluster of two nodes."""

import os
import subprocess
import sys
import time
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

import pytest
from study_kill import INTERVAL_ENV_STEPS, LONG, SHORT, on_ray, on_this_machine
from tiny_study import TINY

from innerattn.cli.main import main
from innerattn.studies.launch.ray import run_workers_on_ray

LOOPBACK = ("0100007F", "0000000000000000FFFF00000100007F", "00000000000000000000000001000000")
"""127.0.0.1, the same in IPv6, and ::1."""
REQUIRED = os.environ.get("INNERATTN_RAY_REQUIRED")  # as in CI
needs_ray = pytest.mark.skipif(
    find_spec("ray") is None and not REQUIRED, reason="ray is not installed"
)


@pytest.mark.long
@needs_ray
@pytest.mark.timeout(900)  # each of its processes loads PyTorch and Ray
def test_a_killed_worker_changes_nothing(tmp_path: Path) -> None:
    text = TINY.replace("train.env_steps = 192", "train.env_steps = 2_400")
    text = text.replace("0..2", "0..1")
    killed = on_ray(tmp_path, text, wanted=1, every_s=4.0)
    assert killed.count > 0


@needs_ray
@pytest.mark.slow
def test_a_worker_is_killed_every_20_s(
    tmp_path: Path, record_property: Callable[[str, object], None]
) -> None:
    """24 runs on two nodes."""
    killed = on_ray(tmp_path, LONG, wanted=14, every_s=20.0)
    assert killed.count > 4
    assert max(killed.lost, default=0) <= INTERVAL_ENV_STEPS
    record_property("workers killed on Ray", killed.count)
    for lost in killed.lost:
        record_property("env-steps worked again after a kill", lost)


@pytest.mark.slow
def test_240_runs_of_which_everything_is_killed_in_the_middle(tmp_path: Path) -> None:
    on_this_machine(tmp_path, SHORT)


def open_to_others() -> set[str]:
    """Places at which this machine listens for others, as Linux lists them."""
    rows = [
        row.split()
        for name in ("tcp", "tcp6")
        for row in Path(f"/proc/net/{name}").read_text().splitlines()[1:]
    ]
    return {row[1] for row in rows if row[3] == "0A" and not row[1].startswith(LOOPBACK)}


@pytest.mark.long
@needs_ray
@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_a_cluster_of_this_machine_listens_to_nobody_else(tmp_path: Path) -> None:
    (tmp_path / "tiny.toml").write_text(TINY)
    before = open_to_others()
    words = [sys.executable, "-m", "innerattn", "study", "run", "tiny.toml", "--ray", "local", "-q"]
    with subprocess.Popen(words, cwd=tmp_path) as command:
        runs = tmp_path / "studies/tiny/runs"
        while not (runs.exists() and any(runs.iterdir())):
            assert command.poll() is None
            time.sleep(0.05)
        during = open_to_others()
    assert command.returncode == 0
    assert during <= before


@needs_ray
def test_a_cluster_that_is_not_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "tiny.toml").write_text(TINY)
    assert main(["study", "run", "tiny.toml", "--ray", "127.0.0.1:9"]) == 1
    said = capsys.readouterr().err
    assert said == ("innerattn: error: --ray 127.0.0.1:9: cannot be reached (Connection refused)\n")
    assert not any((tmp_path / "studies/tiny/runs").iterdir())


def test_without_ray_the_message_names_its_extra(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(ImportError, match=r"--ray needs ray: pip install 'innerattn\[ray\]'"):
        run_workers_on_ray(tmp_path, 1, "local", gpus=0.0, left=lambda: 1)
