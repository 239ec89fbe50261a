"""The process of every worker of a training but the first, which gets a job on its input.

It does its share and writes nothing but rows of its memories. It stops when the first worker says
so, or is gone.
"""

from __future__ import annotations

import json
import mmap
import signal
import socket
import sys
from contextlib import suppress
from pathlib import Path

import torch

from innerattn.config import RunConfig
from innerattn.errors import needs_no_traceback, one_line
from innerattn.learn import workers
from innerattn.train.build import thread_count
from innerattn.train.checkpoint_info import Counters, RowsInfo
from innerattn.train.interruption import Interruptions
from innerattn.train.prepare import prepared
from innerattn.train.resume import read_saved
from innerattn.train.row_files import RowsOnDisk
from innerattn.train.stages import Stages
from innerattn.train.training import Training
from innerattn.train.workers.exchange import Exchange, WorkerEndedError
from innerattn.train.workers.states import own_name, own_part, rows_of_others, state_of_all


class SharedStages(Stages):
    """The part of a training that a worker does who records nothing."""

    def __init__(
        self,
        parts: Training,
        run: Path,
        interruptions: Interruptions,
        counters: Counters | None,
        known: dict[str, RowsInfo],
    ) -> None:
        """Begin, or go on from a checkpoint whose rows of this worker are ``known``."""
        super().__init__(parts, interruptions, counters)
        self._rows = RowsOnDisk(run / "checkpoints" / "rows", known, own_name())
        self._disk_is_full = False

    def _open_rows(self) -> None:
        self._rows.open(self._parts.rings(self._at.stage))

    def _write_whole_row_files(self) -> None:
        if not self._disk_is_full:
            try:
                self._rows.write_whole_files()
            except OSError:  # worker 0 tells of it when it saves
                self._disk_is_full = True

    def _log(self) -> None:
        self._parts.take_tally()

    def _save_if_possible(self) -> None:
        self._disk_is_full = False
        if not self._parts.can_resume:
            return
        stage = self._at.stage
        with suppress(OSError):  # which worker 0 raises, too
            rows_of_others(lambda: self._rows.write(self._parts.rings(stage)))
            state_of_all(self._parts.resume_state(stage))
            workers.total(torch.zeros(1))

    def _save_what_is_there(self) -> None:
        if not self._in_step:
            self._save_if_possible()

    def _finish(self) -> None:
        pass

    def _give_up(self) -> None:
        pass

    def _say_uncompiled(self, why: str) -> None:
        pass

    def _report(self, total: int) -> None:
        pass


def main() -> int:
    """Do the job that the standard input describes; see `innerattn.train.workers.start`.

    Returns:
        The exit code.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    told = json.load(sys.stdin)
    exchange = Exchange(
        told["rank"],
        told["count"],
        mmap.mmap(told["memory"], 0),
        [socket.socket(fileno=told["socket"])],
    )
    try:
        with workers.joined(exchange):
            config = None if told["resumes"] else RunConfig.model_validate(told["config"])
            take_part(Path(told["run"]), config)
    except (KeyboardInterrupt, WorkerEndedError):  # worker 0 stops, or is gone
        return 1
    except Exception as error:
        exchange.fail(one_line(error))
        if not needs_no_traceback(error):
            raise
        return 1
    finally:
        exchange.close()
    return 0


def take_part(run: Path, config: RunConfig | None) -> None:
    """Do this worker's part of a training; it has joined the others.

    Args:
        run: the folder of the run, which worker 0 makes.
        config: of a run that begins; None: go on from the newest checkpoint.
    """
    if config is not None:
        with prepared(config, thread_count(config), "imitating") as ready:
            SharedStages(ready.parts, run, ready.interruptions, None, {}).run()
        return
    saved = read_saved(run)
    info = saved.info
    with prepared(saved.config, saved.run_info.threads, info.counters.stage) as ready:
        saved.load_into(ready.parts)
        stops, known = ready.interruptions, own_part(info.rows)
        SharedStages(ready.parts, run, stops, info.counters, known).run()
