"""Workers of a study as tasks of a Ray cluster, which starts them and remembers nothing.

What is done and who does it stands in the study's folder, which all nodes must see. Ray starts a
worker again when its process or its node dies; the run that it had goes on from its checkpoint.
"""

from __future__ import annotations

import os
import socket
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from innerattn.cores import usable_cores
from innerattn.errors import RunError, missing_library, one_line

LOCAL = "local"
"""The address that stands for a cluster of this machine alone, which ends with the study."""
_LOOPBACK = "127.0.0.1"
_LOOPBACK_ONLY = {"RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER": "0"}
"""With this, Ray binds to loopback on any system; it reads it when it is imported."""
_LOOK_EVERY_S = 1.0
_CONNECT_S = 10.0


def run_workers_on_ray(
    folder: Path,
    count: int | None,
    address: str,
    *,
    gpus: float,
    left: Callable[[], int],
    most_s: float | None = None,
) -> None:
    """Let workers of a Ray cluster do what is left of a study.

    Args:
        folder: of the study, by a path that all nodes see.
        count: how many workers, each with a core; None: as many as there are cores.
        address: of the cluster, ``HOST:PORT``; ``"local"``: one is started here, bound to loopback.
        gpus: what each worker has of a GPU.
        left: gives the number of runs that are neither done nor failed; called often.
        most_s: time after which each worker saves its run and ends [s]; None: there is no limit.

    Raises:
        MissingLibraryError: Ray is not installed.
        RunError: the cluster cannot be reached, or its workers cannot work.
        KeyboardInterrupt: after all workers were asked to save their runs.
    """
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
    if address == LOCAL or address.startswith(f"{_LOOPBACK}:"):
        os.environ.update(_LOOPBACK_ONLY)
    try:
        import ray as library
    except ModuleNotFoundError as error:
        raise missing_library("--ray", error) or error from error
    ray: Any = library
    # Ray knows the word "local", too: a cluster of its own, whatever else runs here.
    options: dict[str, Any] = {
        "address": address,
        "log_to_driver": False,
        "logging_level": "ERROR",
    }
    if address == LOCAL:
        options |= {"num_cpus": count or usable_cores(), "include_dashboard": False}
    try:
        _refuse_unreachable(address)
        ray.init(**options)
    except (ConnectionError, RuntimeError, ValueError, OSError) as error:
        raise RunError(f"--ray {address}: cannot be reached ({one_line(error)})") from error
    try:
        cores = max(1, int(ray.cluster_resources().get("CPU", 1)))
        _wait_for(ray, folder.resolve(), count or cores, gpus, left, most_s)
    finally:
        ray.shutdown()


def _refuse_unreachable(address: str) -> None:
    """Find out at once that nobody listens at HOST:PORT; Ray would try for minutes.

    Raises:
        OSError: nobody does.
    """
    host, colon, port = address.removeprefix("ray://").rpartition(":")
    if colon and port.isdecimal():
        socket.create_connection((host.strip("[]"), int(port)), _CONNECT_S).close()


def _wait_for(
    ray: Any, folder: Path, count: int, gpus: float, left: Callable[[], int], most_s: float | None
) -> None:
    # Only what Ray does is tried again: a worker that raises says what is wrong with the folder.
    task = ray.remote(num_cpus=1, num_gpus=gpus, max_retries=-1)(_work)
    waiting = [task.remote(str(folder), most_s) for _ in range(min(count, left()))]
    try:
        while waiting:
            done, waiting = ray.wait(waiting, timeout=_LOOK_EVERY_S)
            left()
            for one in done:
                try:
                    ray.get(one)
                except ray.exceptions.RayTaskError as error:
                    raise RunError(f"{folder}: a worker on Ray: {one_line(error.cause)}") from error
                except ray.exceptions.RayError as error:
                    raise RunError(f"{folder}: Ray: {one_line(error)}") from error
    except KeyboardInterrupt:
        for one in waiting:
            ray.cancel(one)
        ray.wait(waiting, num_returns=len(waiting), timeout=60.0)
        raise


def _work(folder: str, most_s: float | None) -> None:
    """Be a worker, in a process of the cluster."""
    from innerattn.studies.folder import open_study
    from innerattn.studies.search.state import Watched
    from innerattn.studies.work import work

    until = None if most_s is None else time.monotonic() + most_s
    study = open_study(Path(folder))
    work(study.ledger(), Watched(study).to_do(), until=until)
