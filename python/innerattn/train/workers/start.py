"""Starts the other workers of a training, and ends with them."""

from __future__ import annotations

import json
import mmap
import os
import signal
import socket
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from innerattn.config import RunConfig
from innerattn.cores import usable_cores
from innerattn.errors import ConfigError, RunError
from innerattn.learn import workers
from innerattn.train.workers.exchange import Exchange, WorkerEndedError, memory_bytes
from innerattn.train.workers.torchrun import joined_of_torchrun, started_by_torchrun

MODULE = "innerattn.train.workers"
_MOST_PER_CORE = 4
_PATIENCE_S = 10.0
"""How long a worker may take to end by itself."""


@contextmanager
def started_workers(config: RunConfig, run: Path, *, resumes: bool) -> Iterator[None]:
    """Let this process be worker 0 of `train.workers` inside the block.

    The others are processes that end with the block, however it ends, and with this process. A
    signal from a terminal does not reach them: worker 0 tells them when to stop. Where torchrun has
    started this process, it has started the others, too.

    Args:
        config: the run.
        run: its folder, which need not be there yet.
        resumes: whether they go on from its newest checkpoint.

    Raises:
        ConfigError: there cannot be several workers here.
        RunError: one of them failed, or its process was ended from outside.
    """
    count = config.train.workers
    if count == "auto" or count == 1:  # `train` puts a number for "auto"
        yield
        return
    key = f"train.workers = {count}"
    if config.train.device != "cpu":
        raise ConfigError(f"{key}: must be 1 where train.device = {config.train.device!r}")
    if started_by_torchrun() is not None:
        with joined_of_torchrun(count, run):
            yield
        return
    most = _MOST_PER_CORE * usable_cores()
    if sys.platform == "win32":
        raise ConfigError(f"{key}: must be 1 on Windows")
    if count > most:
        raise ConfigError(f"{key}: must be at most {most}, {_MOST_PER_CORE} for each core here")
    with ExitStack() as open_until_the_end:
        memory = open_until_the_end.enter_context(_memory_without_a_name())
        os.ftruncate(memory, memory_bytes(count))
        others: list[subprocess.Popen[bytes]] = []
        sockets: list[socket.socket] = []
        try:
            for rank in range(1, count):
                ours, theirs = socket.socketpair()
                with theirs:
                    sockets.append(ours)
                    told: dict[str, object] = {
                        "rank": rank,
                        "count": count,
                        "memory": memory,
                        "socket": theirs.fileno(),
                        "config": config.model_dump(mode="json"),
                        "run": os.fspath(run.absolute()),
                        "resumes": resumes,
                    }
                    others.append(_started(told))
            exchange = Exchange(0, count, mmap.mmap(memory, 0), sockets)
            with workers.joined(exchange):
                yield
        except WorkerEndedError as error:
            raise _what_happened(error, others, run) from error
        finally:
            for one in sockets:
                one.close()
            _wait_for(others)


@contextmanager
def _memory_without_a_name() -> Iterator[int]:
    """A file in memory, or where there is no such thing a file that has no name."""
    if hasattr(os, "memfd_create"):
        descriptor = os.memfd_create("innerattn")
        try:
            yield descriptor
        finally:
            os.close(descriptor)
    else:
        with tempfile.TemporaryFile() as file:
            yield file.fileno()


def _started(told: dict[str, object]) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-P", "-m", MODULE]  # -P: nothing from the folder we are in
    handed_down = [told["memory"], told["socket"]]
    process = subprocess.Popen(
        command,
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        pass_fds=handed_down,  # type: ignore[arg-type]
        process_group=0,
    )
    assert process.stdin is not None
    with process.stdin as stdin:
        stdin.write(json.dumps(told).encode())
    return process


def _what_happened(
    error: WorkerEndedError, others: list[subprocess.Popen[bytes]], run: Path
) -> RunError:
    """Why a worker ended, by what it told or by its exit code."""
    if error.text or error.rank is None:
        return error
    try:
        code = others[error.rank - 1].wait(_PATIENCE_S)
    except subprocess.TimeoutExpired:
        return RunError(f"worker {error.rank} does not answer")
    how = f"signal {signal.Signals(-code).name}" if code < 0 else f"exit code {code}"
    return RunError(
        f"worker {error.rank} ended with {how}; go on from what was saved last with: "
        f"innerattn train --resume {run}"
    )


def _wait_for(processes: list[subprocess.Popen[bytes]]) -> None:
    """Wait until all processes are gone; they end when they hear no more of worker 0."""
    try:
        for one in processes:
            try:
                one.wait(_PATIENCE_S)
            except subprocess.TimeoutExpired:
                one.kill()
                one.wait()
    except BaseException:
        for one in processes:
            one.kill()
        raise
