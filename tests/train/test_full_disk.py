"""A disk that is full during a save: the old checkpoint loads, and the run goes on or can go on."""

import json
import logging
import os
import re
import resource
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from innerattn.config import RunConfig, write_toml
from innerattn.records.run_folder import read_info
from innerattn.train import Progress, load_newest, resume, train
from innerattn.train.resume import read_saved
from innerattn.train.saved import whole_checkpoints

Configure = Callable[..., RunConfig]

OFTEN = {
    "train.checkpoint_every_env_steps": 24,
    "train.checkpoint_every_minutes": 0.0,
    "train.env_steps": 720,
    "td.replay_capacity": 300,
}
FULL_AT, FREE_AT, SAVED_BEFORE = 240, 480, 216
"""Env-steps; a checkpoint follows on the report of its env-step, so that of 240 fails."""
OFFSETS = 50
SHORT = (0, 20, 40, 49)
MOUNT_REQUIRED = "INNERATTN_MOUNT_REQUIRED"
"""Environment variable that makes a file system that cannot be mounted a failure."""


def debris(run: Path) -> list[str]:
    partial = re.compile(r"\..+\.[0-9a-f]{16}")
    return [str(path) for path in run.rglob("*") if partial.fullmatch(path.name)]


def sizes_of_a_save(run: Path) -> list[int]:
    """Sizes of the files in the newest checkpoint's folder [bytes]."""
    newest = run / "checkpoints" / str(whole_checkpoints(run / "checkpoints")[-1])
    return [file.stat().st_size for file in newest.iterdir()]


def train_with_an_outage(
    config: RunConfig, run: Path, begin: Callable[[], object], end: Callable[[], object]
) -> list[str]:
    """Train while no save succeeds between two env-steps; what was said."""
    said: list[str] = []

    class Listener(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            said.append(record.getMessage())

    def progress(now: Progress) -> None:
        checkpoints = whole_checkpoints(run / "checkpoints")
        if now.env_steps == FULL_AT:
            assert checkpoints[-1] == SAVED_BEFORE
            begin()
        if now.env_steps == FREE_AT:
            assert checkpoints[-1] == SAVED_BEFORE
            assert read_saved(run).number == SAVED_BEFORE
            assert load_newest(run).env_steps == SAVED_BEFORE
            end()
        if now.env_steps == FREE_AT + 24:
            assert checkpoints[-1] == FREE_AT  # it saves again

    log, listener = logging.getLogger("innerattn"), Listener()
    log.addHandler(listener)
    try:
        train(config, run, progress=progress)
    finally:
        log.removeHandler(listener)
    assert read_info(run).state == "done"
    lines = [json.loads(line) for line in (run / "metrics.jsonl").read_text().splitlines()]
    assert [line["env_steps"] for line in lines] == [204, 408, 600, 720]
    assert debris(run) == []
    return said


def said_once(said: list[str], run: Path, why: str) -> None:
    """One line, which names a file of the run and the reason."""
    (text,) = said
    assert re.search(re.escape(str(run)) + r"/[\w./-]+: cannot be written", text), text
    assert why in text
    assert "\n" not in text


@contextmanager
def limits_restored() -> Iterator[Callable[[int], None]]:
    """Gives what lets no file grow beyond a size, as a disk that is full would."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)

    def limit(size: int) -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))

    try:
        yield limit
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.mark.parametrize(
    "number",
    [n if n in SHORT else pytest.param(n, marks=pytest.mark.slow) for n in range(OFFSETS)],
)
def test_a_save_that_fails_at_any_offset_stops_no_training(
    small_config: Configure, tmp_path: Path, number: int
) -> None:
    run = tmp_path / "run"
    offsets = []

    def begin() -> None:
        largest = max(sizes_of_a_save(run)) - 1
        offsets.append(
            round(largest ** (number / (OFFSETS - 1)))
        )  # from the first byte to the last
        limit(offsets[0])

    with limits_restored() as limit:
        said = train_with_an_outage(
            small_config(**OFTEN), run, begin, lambda: limit(resource.RLIM_INFINITY)
        )
    assert offsets
    said_once(said, run, "File too large")


def test_a_disk_that_stays_full_ends_with_the_old_checkpoint(
    small_config: Configure, tmp_path: Path
) -> None:
    run = tmp_path / "run"

    def progress(now: Progress) -> None:
        if now.env_steps == FULL_AT:
            limit(200)

    with limits_restored() as limit, pytest.raises(OSError, match=re.escape(str(run))):
        train(small_config(**OFTEN), run, progress=progress)
    assert read_info(run).state == "running"  # no room for a word: run.json is as it was
    assert read_saved(run).number == SAVED_BEFORE
    assert resume(run) == run
    assert read_info(run).state == "done"


ON_A_SMALL_DISK = """
import json, os, subprocess, sys
from pathlib import Path
sys.path.insert(0, sys.argv[1])
from test_full_disk import FULL_AT, sizes_of_a_save, train_with_an_outage
from innerattn.config import read_toml
from innerattn.train import resume, train
from innerattn.train.resume import read_saved

disk, config = Path(sys.argv[2]), read_toml(sys.argv[3])
made = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=4m", "tmpfs", str(disk)])
if made.returncode:
    sys.exit(77)

def fill(left):
    found = os.statvfs(disk)
    (disk / "filler").write_bytes(bytes(found.f_bavail * found.f_frsize - left))
    assert os.statvfs(disk).f_bavail * found.f_frsize == left

said = []
for share in map(float, sys.argv[4:]):
    run = disk / "run"
    def begin():
        fill(int(share * sum(sizes_of_a_save(run))) // 4096 * 4096)
    said.append(train_with_an_outage(config, run, begin, (disk / "filler").unlink))
    subprocess.run(["rm", "-r", run], check=True)

def progress(now):
    if now.env_steps == FULL_AT:
        fill(left)
def state():
    return json.loads((run / "run.json").read_text())["state"]

ends = []
for left in (0, 20480):
    run = disk / "stays-full"
    try:
        train(config, run, progress=progress)
    except OSError as error:
        end = f"{error.strerror}: {error.filename}"
    ends.append([end, state(), read_saved(run).number])
    (disk / "filler").unlink()
    resume(run)
    ends[-1].append(state())
    subprocess.run(["rm", "-r", run], check=True)
print(json.dumps({"said": said, "ends": ends}))
"""


def unshare() -> list[str]:
    """What runs a command in a mount namespace of its own."""
    user = [] if os.geteuid() == 0 else ["--user", "--map-root-user"]
    return ["unshare", *user, "--mount"]


def not_mounted(why: str) -> None:
    text = f"no file system could be mounted for this test: {why}"
    if os.environ.get(MOUNT_REQUIRED) or os.environ.get("CI"):
        pytest.fail(text)
    pytest.skip(text)


@pytest.mark.parametrize(
    "shares",
    [(0.5,), pytest.param([n / 25 for n in range(25)], marks=pytest.mark.slow)],
    ids=["one size", "25 sizes"],
)
@pytest.mark.long
def test_on_a_small_file_system(
    small_config: Configure, tmp_path: Path, shares: tuple[float, ...]
) -> None:
    disk = tmp_path / "disk"
    disk.mkdir()
    write_toml(small_config(**OFTEN), tmp_path / "config.toml")
    if shutil.which("unshare") is None or shutil.which("mount") is None:
        not_mounted("there is no unshare, or no mount")
    command = [*unshare(), sys.executable, "-c", ON_A_SMALL_DISK, str(Path(__file__).parent)]
    command += [str(disk), str(tmp_path / "config.toml"), *map(str, shares)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode == 77 or done.stderr.startswith("unshare:"):
        not_mounted(done.stderr.strip())
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert len(found["said"]) == len(shares)
    for said in found["said"]:
        said_once(said, disk / "run", "No space left on device")
    for end, state, old, state_after in found["ends"]:
        assert end.startswith(f"No space left on device: {disk}/stays-full/")
        assert (state, old, state_after) == ("interrupted", SAVED_BEFORE, "done")
