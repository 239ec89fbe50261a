"""A training as a whole: begins one in a new run folder, or goes on with one that was stopped.

It knows the `Learner` protocol and no algorithm, and does not evaluate.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from dataclasses import replace
from pathlib import Path

import torch

from innerattn.config import RunConfig
from innerattn.config.streams import stream_seed
from innerattn.envs import BatchEnv
from innerattn.records.run_files import RunFiles
from innerattn.records.run_folder import config_of
from innerattn.train.build import keep_heap_small, thread_count, torch_threads
from innerattn.train.checkpoint import RunFolder, refuse_existing, versions
from innerattn.train.checkpoint_info import Stage
from innerattn.train.compilation import compiles
from innerattn.train.interruption import Interruptions, remembered_interruptions
from innerattn.train.matmul_backend import chosen_matmul_backend
from innerattn.train.parts import Parts
from innerattn.train.progress import Progress
from innerattn.train.resume import NothingSavedError, NothingToResumeError, Saved, read_saved
from innerattn.train.run_lock import only_training_in
from innerattn.train.saved import Checkpoints
from innerattn.train.stages import Stages

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
    refuse_existing(path)
    threads = thread_count(config)
    with _prepared(config, threads, "imitating") as (parts, compiled, backend, interruptions):
        folder = RunFolder.create(path, config, threads, compiled, backend)
        with only_training_in(path):
            Stages(parts, folder, interruptions, progress).run()
            interruptions.check()
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
    with only_training_in(path):
        try:
            saved = read_saved(path)
        except NothingSavedError:
            _begin_anew(path, progress)
            return path
        info, stage = saved.run_info, saved.info.counters.stage
        # A run that was not compiled goes on alike.
        prepared = _prepared(saved.config, info.threads, stage, compilable=info.compiled)
        with prepared as (parts, compiled, backend, stops):
            if parts.resumable is None:
                method = saved.config.train.method
                raise NothingToResumeError(f"{path}: method {method!r} cannot go on from a file")
            saved.load_into(parts)
            _warn_of_changes(saved, compiled, backend)
            folder = RunFolder(path, replace(info, resumed=info.resumed + 1))
            counters = saved.info.counters
            folder.mark("running", saved.number, parts.learner.updates, counters.seconds)
            keep = saved.config.train.keep_checkpoints
            Checkpoints(path, saved.config.digest(), keep).sweep(saved.number)
            Stages(parts, folder, stops, progress, saved.info).run()
            stops.check()
    return path


def _begin_anew(path: Path, progress: Callable[[Progress], None] | None) -> None:
    """Train in a folder whose training was stopped before it saved anything."""
    files = RunFiles(path)
    config = config_of(files)
    with _prepared(config, files.info.threads, "imitating") as (parts, compiled, backend, stops):
        folder = RunFolder.begin_anew(path, config, files.info, compiled, backend)
        Stages(parts, folder, stops, progress).run()
        stops.check()


@contextmanager
def _prepared(
    config: RunConfig, threads: int, stage: Stage, *, compilable: bool = True
) -> Iterator[tuple[Parts, bool, str, Interruptions]]:
    """The parts of a training, whether updates are compiled, and by what matrices are multiplied.

    Raises:
        ConfigError: the configuration cannot be run here.
    """
    keep_heap_small()
    with (
        torch_threads(threads),
        chosen_matmul_backend(config.train.matmul_backend) as matmul_backend,
        remembered_interruptions() as interruptions,
    ):
        env = BatchEnv(
            config.training_scenario,
            config.train.num_envs,
            seed=stream_seed(config.train.seed, "training"),
            num_threads=config.train.threads,
            copy=False,
        )
        with closing(env):
            parts = Parts(config, env, stage)
            compiled = compilable and compiles(config)
            if compiled:
                # The compiler counts the graphs of a process, and gives up after eight. Those of
                # earlier runs are of no use to this one, which shall be compiled, too.
                torch.compiler.reset()
                parts.learner.compile()
            yield parts, compiled, matmul_backend, interruptions


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
