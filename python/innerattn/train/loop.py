"""A training as a whole: begins one in a new run folder, or goes on with one that was stopped.

It knows the `Learner` protocol and no algorithm, and does not evaluate.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from innerattn.config import RunConfig
from innerattn.records.run_files import RunFiles
from innerattn.records.run_folder import config_of
from innerattn.train.build import thread_count
from innerattn.train.checkpoint import RunFolder, refuse_existing, versions
from innerattn.train.prepare import prepared
from innerattn.train.progress import Progress
from innerattn.train.recorded import RecordedStages
from innerattn.train.resume import NothingSavedError, NothingToResumeError, Saved, read_saved
from innerattn.train.run_lock import only_training_in
from innerattn.train.saved import Checkpoints, nothing_was_saved
from innerattn.train.workers.choose import with_number_of_workers
from innerattn.train.workers.start import started_workers
from innerattn.train.workers.torchrun import is_other_worker, joined_of_torchrun
from innerattn.train.workers.worker import take_part

__all__ = ["Progress", "resume", "train"]

_log = logging.getLogger(__name__)


def train(
    config: RunConfig,
    run_dir: str | Path,
    *,
    progress: Callable[[Progress], None] | None = None,
) -> Path:
    """Train as ``config`` says and leave a run folder.

    Args:
        config: the run.
        run_dir: where the run folder is made; nothing may be there yet.
        progress: called after every control step of all worlds.

    Returns:
        The run folder.

    Raises:
        RunError: ``run_dir`` exists or cannot be made, or training diverged.
        ConfigError: the configuration cannot be run here.
        OSError: training is at its end, and what was learnt cannot be written.
        KeyboardInterrupt: after everything is saved and the state is set to "interrupted";
            `resume` goes on.
    """
    path = Path(run_dir)
    config = with_number_of_workers(config)
    if is_other_worker():
        with joined_of_torchrun(config.train.workers, path) as path:
            take_part(path, config)
        return path
    refuse_existing(path)
    threads = thread_count(config)
    with (
        started_workers(config, path, resumes=False),
        prepared(config, threads, "imitating") as ready,
    ):
        folder = RunFolder.create(path, config, threads, ready.compiled, ready.matmul_backend)
        with only_training_in(path):
            RecordedStages(ready.parts, folder, ready.interruptions, progress).run()
            ready.interruptions.raise_if_asked()
    return path


def resume(run_dir: str | Path, *, progress: Callable[[Progress], None] | None = None) -> Path:
    """Go on with a training that was stopped, from its newest checkpoint, as if it had not been.

    One that was stopped before its first checkpoint begins anew in its folder.

    Args:
        run_dir: the run folder.
        progress: called after every control step of all worlds.

    Returns:
        The run folder.

    Raises:
        NothingToResumeError: the run is done, has no checkpoint that it could go on from, or its
            learner cannot go on in another process.
        DamagedCheckpointError: a file of the checkpoint is damaged; nothing has changed.
        RunError, ConfigError, OSError, KeyboardInterrupt: as of `train`; or another process is
            training in the folder.
    """
    path = Path(run_dir)
    if is_other_worker():
        files = RunFiles(path)
        config, anew = config_of(files), nothing_was_saved(path, files.info)
        with joined_of_torchrun(config.train.workers, path):
            take_part(path, config if anew else None)
        return path
    with only_training_in(path):
        try:
            saved = read_saved(path)
        except NothingSavedError:
            _begin_anew(path, progress)
            return path
        _go_on(path, saved, progress)
    return path


def _go_on(path: Path, saved: Saved, progress: Callable[[Progress], None] | None) -> None:
    info, stage = saved.run_info, saved.info.counters.stage
    with (
        started_workers(saved.config, path, resumes=True),
        # A run that was not compiled goes on alike.
        prepared(saved.config, info.threads, stage, compilable=info.compiled) as ready,
    ):
        parts = ready.parts
        if not parts.can_resume:
            method = saved.config.train.method
            raise NothingToResumeError(f"{path}: method {method!r} cannot go on from a file")
        saved.load_into(parts)
        _warn_of_changes(saved, ready.compiled, ready.matmul_backend)
        folder = RunFolder(path, replace(info, resumed=info.resumed + 1))
        counters = saved.info.counters
        folder.mark("running", saved.number, parts.updates, counters.seconds)
        keep = saved.config.train.keep_checkpoints
        Checkpoints(path, saved.config.digest(), keep).sweep(saved.number)
        RecordedStages(parts, folder, ready.interruptions, progress, saved.info).run()
        ready.interruptions.raise_if_asked()


def _begin_anew(path: Path, progress: Callable[[Progress], None] | None) -> None:
    """Train in a folder whose training was stopped before it saved anything."""
    files = RunFiles(path)
    config = config_of(files)
    with (
        started_workers(config, path, resumes=False),
        prepared(config, files.info.threads, "imitating") as ready,
    ):
        compiled, backend = ready.compiled, ready.matmul_backend
        folder = RunFolder.begin_anew(path, config, files.info, compiled, backend)
        RecordedStages(ready.parts, folder, ready.interruptions, progress).run()
        ready.interruptions.raise_if_asked()


def _warn_of_changes(saved: Saved, compiled: bool, backend: str) -> None:
    """Say what may make the rest of a run differ in the last bits from what it would have been."""
    info, now = saved.run_info, versions()
    changes = [
        f"{name} {info.versions.get(name, 'none')} is now {now[name]}"
        for name in now
        if info.versions.get(name) != now[name]
    ]
    if info.compiled != compiled:
        changes.append("updates are no longer compiled")
    if info.matmul_backend.partition(",")[0] != backend.partition(",")[0]:
        changes.append("another library multiplies matrices")
    if changes:
        _log.warning(
            "innerattn: warning: %s: %s; what is learnt may differ in the last bits from a run "
            "without a stop",
            saved.run,
            ", ".join(changes),
        )
