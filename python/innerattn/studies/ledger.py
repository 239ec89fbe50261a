"""Which runs of a study are done, claimed, free or failed; it knows no run and no launcher.

The state follows from names of files alone, so workers on several machines need only a folder that
all of them see: no server, no lock, no common clock.

    runs/KEY            what a finished run left; it appears whole
    claims/KEY.N        the Nth claim of a run; the claim with the highest number is in force
    claims/KEY.N.beat   a number that its worker changes as long as it works
    claims/KEY.N.free   the worker gave the claim back
    claims/KEY.N.failed why the run failed
    claims/KEY.N.died   the worker ended without a word, and had saved nothing of its own
    work/KEY.N/KEY      where the worker of that claim writes, and nobody else

A claim is made by a hard link, which one of several workers gets. It is taken over by a claim with
the next number once its beat has not changed for a while by the clock of the worker that looks, or
at once where that worker sees that the process is gone. The new claim works in a copy of what the
old one left, so a worker that was only slow can harm nothing.
"""

from __future__ import annotations

import errno
import os
import re
import secrets
import shutil
import time
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from innerattn.config.files import sync_folder, write_whole
from innerattn.errors import RunError
from innerattn.records.logged import METRICS
from innerattn.studies.owner import is_gone, this_process

State = Literal["planned", "claimed", "done", "failed"]
MOST_FAILURES = 3
"""Failures after which a run is not tried again."""
MOST_DEATHS = 5
"""Workers after which a run is not tried again that all ended without a word and saved nothing, as
where its memory is more than there is."""
SILENT_AFTER_S = 60.0
"""How long a claim's beat may stand still before others take the run over."""

_KEY = re.compile(r"[A-Za-z0-9_-]{1,128}")
_CLAIM = re.compile(r"([A-Za-z0-9_-]{1,128})\.([1-9][0-9]{0,8})(\.free|\.failed|\.died)?")
_NO_LINKS = (errno.EPERM, errno.ENOTSUP, errno.EMLINK, errno.ENOSYS, errno.EINVAL)
_MOST_REASON_BYTES = 1 << 16
_COPIES = 3
_MOST_OWNER_BYTES = 1 << 10


class ClaimLostError(RunError):
    """Another worker has taken the run over, or has finished it."""


@dataclass
class _Run:
    """What the names of files say of a run: its last claim, and what became of its claims."""

    number: int = 0
    over: int = 0
    """Number of the last claim that was given back or failed."""
    failures: int = 0
    deaths: int = 0

    @property
    def given_up(self) -> bool:
        """Whether it is not tried again."""
        return self.failures >= MOST_FAILURES or self.deaths >= MOST_DEATHS


class Claim:
    """The right to work on a run, until it is finished, has failed, is given back or is lost."""

    def __init__(self, ledger: Ledger, key: str, number: int) -> None:
        """See `Ledger.claim`."""
        self._ledger = ledger
        self.key = key
        self.number = number
        self.folder = ledger.folder / "work" / f"{key}.{number}" / key
        """Where to work: what earlier claims of the run left, or nothing yet."""
        self._path = ledger.folder / "claims" / f"{key}.{number}"
        self._beats = 0

    def beat(self) -> None:
        """Say that the worker is at work.

        Raises:
            ClaimLostError: the run is another worker's by now, or is finished.
            OSError: the ledger cannot be written.
        """
        self._refuse_lost()
        self._beats += 1
        write_whole(self._path.with_name(f"{self._path.name}.beat"), b"%d\n" % self._beats)

    def finish(self) -> Path:
        """Put the folder among the finished runs.

        Returns:
            Where it is now.

        Raises:
            ClaimLostError: another worker was faster; the folder is removed.
            OSError: the ledger cannot be written.
        """
        done = self._ledger.folder / "runs" / self.key
        try:
            os.rename(self.folder, done)
        except OSError as error:
            if error.errno not in (errno.EEXIST, errno.ENOTEMPTY):
                raise
            shutil.rmtree(self.folder.parent, ignore_errors=True)
            raise ClaimLostError(f"{done}: another worker has finished it") from error
        sync_folder(done.parent)
        for number in range(1, self.number + 1):
            left = self._ledger.folder / "work" / f"{self.key}.{number}"
            shutil.rmtree(left, ignore_errors=True)
        return done

    def fail(self, reason: str) -> None:
        """Give the run back because it failed.

        Args:
            reason: why; its end is kept where it is long.

        Raises:
            OSError: the ledger cannot be written.
        """
        text = reason.encode("utf-8", "backslashreplace")[-_MOST_REASON_BYTES:]
        write_whole(self._path.with_name(f"{self._path.name}.failed"), text)

    def free(self) -> None:
        """Give the run back; the next worker goes on from what is in the folder.

        Raises:
            OSError: the ledger cannot be written.
        """
        write_whole(self._path.with_name(f"{self._path.name}.free"), b"")

    def _refuse_lost(self) -> None:
        newer = self._path.with_name(f"{self.key}.{self.number + 1}")
        if os.path.lexists(newer):
            raise ClaimLostError(f"{newer}: another worker has taken the run over")
        done = self._ledger.folder / "runs" / self.key
        if os.path.lexists(done):
            raise ClaimLostError(f"{done}: another worker has finished it")


class Ledger:
    """The runs of a study in a folder.

    Args:
        folder: of the study; it is made if needed.
        silent_after_s: how long a claim's beat may stand still before it is taken over [s]; some
            times the interval of its beats.
        clock: seconds that only grow; the worker's own, never compared with another machine's.

    Raises:
        OSError: the folder cannot be made.
    """

    def __init__(
        self,
        folder: Path,
        *,
        silent_after_s: float = SILENT_AFTER_S,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.folder = folder
        self._silent_after_s = silent_after_s
        self._clock = clock
        self._beats: dict[tuple[str, int], tuple[str, float]] = {}
        for name in ("runs", "claims", "work"):
            (folder / name).mkdir(parents=True, exist_ok=True)

    def states(self, keys: Iterable[str]) -> dict[str, State]:
        """The state of each run, from two listings of folders.

        Raises:
            OSError: the ledger cannot be read.
        """
        done, runs = self._listed()
        return {key: _state(key in done, runs.get(key)) for key in keys}

    def retry(self, keys: Iterable[str]) -> list[str]:
        """Let those of some runs that were given up be tried again, from what they had saved.

        Returns:
            Their names.

        Raises:
            OSError: the ledger cannot be read or written.
        """
        given_up = [key for key, state in self.states(keys).items() if state == "failed"]
        for key in given_up:
            for end in ("failed", "died"):
                for mark in self.folder.glob(f"claims/{key}.*.{end}"):
                    mark.replace(mark.with_suffix(".free"))
        return given_up

    def at_work(self) -> dict[str, Path]:
        """Folders of the runs that are claimed, by key; they may not be there yet.

        Raises:
            OSError: the ledger cannot be read.
        """
        done, runs = self._listed()
        return {
            key: self.folder / "work" / f"{key}.{run.number}" / key
            for key, run in runs.items()
            if _state(key in done, run) == "claimed"
        }

    def failures(self, key: str) -> list[str]:
        """Why the tries of a run failed or ended without a word, the last one last.

        Raises:
            OSError: the ledger cannot be read.
        """
        paths = (
            path for end in ("failed", "died") for path in self.folder.glob(f"claims/{key}.*.{end}")
        )
        ordered = sorted(paths, key=lambda path: int(path.name.split(".")[1]))
        return [path.read_text("utf-8", "replace") for path in ordered]

    def claim(self, keys: Iterable[str]) -> Claim | None:
        """Claim the first of some runs that nobody works on; none if there is none now.

        A claim of a worker that fell silent is taken over, but only after this ledger has watched
        it for a while: call again as long as some runs are neither done nor failed.

        Args:
            keys: names of runs in the order of preference: letters, digits, "-" and "_".

        Raises:
            ValueError: another name.
            OSError: the ledger cannot be read or written.
        """
        done, runs = self._listed()
        for key in keys:
            if not _KEY.fullmatch(key):
                raise ValueError(f"key = {key!r}: must be letters, digits, '-' and '_'")
            run = runs.get(key, _Run())
            if key in done or run.given_up:
                continue
            silent = run.number > run.over
            if silent and not self._silent(key, run.number):
                continue
            if silent and self._died_for_nothing(key, run.number) and run.deaths + 1 >= MOST_DEATHS:
                continue
            claim = self._claimed(key, run.number + 1)
            if claim is not None:
                return claim
        return None

    def _died_for_nothing(self, key: str, number: int) -> bool:
        """Note a claim whose worker is gone, and whether it has saved nothing since it began."""
        before, after = (
            _read(self.folder / "work" / f"{key}.{one}" / key / "checkpoints" / "latest")
            for one in (number - 1, number)
        )
        if before == after:
            reason = "its worker ended without a word, and had saved nothing of its own"
            write_whole(self.folder / "claims" / f"{key}.{number}.died", reason.encode())
        return before == after

    def _claimed(self, key: str, number: int) -> Claim | None:
        """The claim with that number, unless another worker gets it."""
        claim = Claim(self, key, number)
        if not made_alone(self.folder / "claims" / f"{key}.{number}", this_process()):
            return None
        try:
            claim.beat()
            self._copy_what_was_left(claim)
        except ClaimLostError:  # finished in between
            return None
        return claim

    def _copy_what_was_left(self, claim: Claim) -> None:
        """Begin with what the newest earlier claim left, if there is something to copy whole."""
        claim.folder.parent.mkdir(exist_ok=True)
        partial = claim.folder.with_name("partial")
        for earlier in range(claim.number - 1, 0, -1):
            left = self.folder / "work" / f"{claim.key}.{earlier}" / claim.key
            for _ in range(_COPIES if left.is_dir() else 0):
                try:
                    shutil.copytree(left, partial, symlinks=True, copy_function=_link_or_copy)
                except (shutil.Error, OSError):  # its worker was only slow, and still writes
                    shutil.rmtree(partial, ignore_errors=True)
                else:
                    os.rename(partial, claim.folder)
                    return

    def _silent(self, key: str, number: int) -> bool:
        """Whether the beat of a claim has not changed while this ledger watched."""
        if is_gone(_read(self.folder / "claims" / f"{key}.{number}")):
            return True
        now = self._clock()
        beat = _read(self.folder / "claims" / f"{key}.{number}.beat")
        seen, since = self._beats.get((key, number), (None, now))
        if seen != beat:
            since = now
        self._beats[key, number] = (beat, since)
        return now - since >= self._silent_after_s

    def _listed(self) -> tuple[set[str], dict[str, _Run]]:
        """Finished runs, and what the names of claims say of each run."""
        runs: dict[str, _Run] = {}
        for name in os.listdir(self.folder / "claims"):
            found = _CLAIM.fullmatch(name)
            if found is None:
                continue
            run = runs.setdefault(found[1], _Run())
            if found[3] is None:
                run.number = max(run.number, int(found[2]))
            else:
                run.over = max(run.over, int(found[2]))
                run.failures += found[3] == ".failed"
                run.deaths += found[3] == ".died"
        return set(os.listdir(self.folder / "runs")), runs


def _state(done: bool, run: _Run | None) -> State:
    if done:
        return "done"
    if run is None:
        return "planned"
    if run.given_up:
        return "failed"
    return "claimed" if run.number > run.over else "planned"


def _read(path: Path) -> str:
    """The text of a small file, empty where there is none."""
    try:
        with path.open("rb") as file:
            return file.read(_MOST_OWNER_BYTES).decode("utf-8", "replace")
    except (FileNotFoundError, NotADirectoryError):
        return ""


def made_alone(path: Path, text: str) -> bool:
    """Make a file that nobody else has made, whole; whether it was this call that made it.

    Raises:
        OSError: it cannot be written.
    """
    own = path.with_name(f".{path.name}.{secrets.token_hex(8)}")
    own.write_text(text, "utf-8")
    try:
        os.link(own, path)
    except FileExistsError:
        # Over NFS a link may be made although its answer was lost and it was asked for again.
        return os.stat(own).st_nlink == 2
    except OSError as error:
        if error.errno not in _NO_LINKS:
            raise
        return _opened_alone(path, text)  # a file system without hard links
    finally:
        with suppress(OSError):
            own.unlink()
    return True


def _opened_alone(path: Path, text: str) -> bool:
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(text)
    except FileExistsError:
        return False
    return True


def _link_or_copy(source: str, target: str) -> None:
    """A hard link where the file is only ever replaced; a copy of one that grows."""
    if os.path.basename(source) != METRICS:
        try:
            os.link(source, target, follow_symlinks=False)
            return
        except OSError:
            pass
    shutil.copy2(source, target, follow_symlinks=False)
