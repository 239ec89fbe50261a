"""Reads the newest checkpoint of a run, for its training to go on; nothing in it is trusted."""

from __future__ import annotations

from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from innerattn.config import RunConfig
from innerattn.envs import BatchEnv
from innerattn.errors import RunError
from innerattn.learn.resume import State
from innerattn.records.logged import METRICS
from innerattn.records.run_files import RunFiles
from innerattn.records.run_folder import RunInfo, config_of
from innerattn.train.build import refuse_larger_networks
from innerattn.train.checkpoint_info import MOST_BYTES as MOST_INFO_BYTES
from innerattn.train.checkpoint_info import CheckpointInfo, checkpoint_info
from innerattn.train.metrics import MetricsFile
from innerattn.train.row_files import FORMAT as ROWS_FORMAT
from innerattn.train.row_files import file_name, read_rows
from innerattn.train.saved import INFO, STATE_FORMAT, nothing_was_saved, whole_checkpoints
from innerattn.train.training import Training
from innerattn.train.weights import FORMAT, MOST_BYTES, tensors_in
from innerattn.train.workers.states import own_name, own_part


class NothingToResumeError(RunError):
    """A run has no checkpoint that its training could go on from."""


class NothingSavedError(NothingToResumeError):
    """A training was stopped before its first checkpoint; it can begin anew in its folder."""


class DamagedCheckpointError(RunError):
    """The newest checkpoint of a run cannot be read; the message names the file."""


@dataclass(frozen=True)
class Saved:
    """The newest checkpoint of a run.

    Attributes:
        run: the folder.
        config: of the run.
        run_info: what ``run.json`` says.
        number: of the checkpoint, its env-steps.
        info: what ``checkpoint.json`` says.
        weights: everything learnt, by name.
        state: everything else but the large memories, by name.
    """

    run: Path
    config: RunConfig
    run_info: RunInfo
    number: int
    info: CheckpointInfo
    weights: State
    state: State

    def load_into(self, parts: Training) -> None:
        """Let a training that was built anew go on from here.

        Raises:
            DamagedCheckpointError: the checkpoint does not fit it, or a file is damaged.
        """
        stage = self.info.counters.stage
        folder = self.run / "checkpoints"
        rings, rows = parts.rings(stage), own_part(self.info.rows)
        place = folder / str(self.number)
        if rings.keys() != rows.keys():
            raise _damaged(f"{place / INFO}: rows {sorted(self.info.rows)}: not those of this run")
        try:
            for name, ring in rings.items():
                read_rows(folder / "rows", own_name() + name, ring, rows[name])
        except RunError as error:
            raise _damaged(str(error)) from error
        try:
            parts.load(self.weights, own_part(self.state), stage)
        except ValueError as error:
            raise _damaged(f"{place / 'state.safetensors'}: {error}") from error


def newest_checkpoint(run: Path) -> int | None:
    """How many env-steps the newest checkpoint of a run has done; None without a checkpoint.

    After a `kill -9` this is less than `run.json` says, which is written more often.
    """
    numbers = whole_checkpoints(run / "checkpoints")
    return numbers[-1] if numbers else None


def read_saved(run: Path) -> Saved:
    """The newest checkpoint of a run.

    Raises:
        NothingToResumeError: the run is done, or has no checkpoint that it could go on from;
            `NothingSavedError` if it was stopped before its first one.
        DamagedCheckpointError: a file of the checkpoint is damaged.
        RunError: there is no run, a file of it is damaged, or its weights are too few for its
            networks.
        ConfigError: its configuration is not valid.
    """
    files = RunFiles(run)
    config = config_of(files)
    if files.info.state == "done":
        raise NothingToResumeError(f"{run}: is done; measure it with: innerattn evaluate {run}")
    folder = run / "checkpoints"
    number = newest_checkpoint(run)
    if number is None:
        if nothing_was_saved(run, files.info):
            raise NothingSavedError(f"{run}: was stopped before its first checkpoint")
        raise NothingToResumeError(f"{run}: holds no checkpoint that training could go on from")
    name = f"checkpoints/{number}"
    try:
        info = _info(files.read(f"{name}/{INFO}", MOST_INFO_BYTES), run / name / INFO)
        if info.counters.env_steps != number:
            raise RunError(f"{run / name / INFO}: is of {info.counters.env_steps} env-steps")
        read = {
            file: tensors_in(files.read(file, MOST_BYTES), run / file, form, sha256)
            for file, form, sha256 in (
                (f"{name}/weights.safetensors", FORMAT, info.weights_sha256),
                (f"{name}/state.safetensors", STATE_FORMAT, info.state_sha256),
            )
        }
        MetricsFile(run / METRICS).verified(info.metrics_bytes, info.metrics_sha256)
    except RunError as error:
        raise _damaged(str(error), folder, whole_checkpoints(folder)) from error
    if info.config_sha256 != config.digest():
        raise RunError(
            f"{run / 'config.toml'}: is not the configuration of checkpoint {number}; a run goes "
            "on as it began"
        )
    weights, state = read.values()
    with closing(BatchEnv(config.scenario, 1, num_threads=1)) as env:
        refuse_larger_networks(config, env, weights, run / name / "weights.safetensors")
    return Saved(run, config, files.info, number, info, weights, state)


def verify_checkpoints(run: Path) -> set[str]:
    """Read every checkpoint of a run that is over, with all files that it needs.

    Returns:
        The names of these files in the run.

    Raises:
        RunError: a file is missing, damaged, or none of its checkpoint.
    """
    files, found = RunFiles(run), set()
    for number in whole_checkpoints(run / "checkpoints"):
        name = f"checkpoints/{number}/{INFO}"
        info = _info(files.read(name, MOST_INFO_BYTES), run / name)
        parts = {
            f"checkpoints/{number}/weights.safetensors": (FORMAT, info.weights_sha256),
            f"checkpoints/{number}/state.safetensors": (STATE_FORMAT, info.state_sha256),
        }
        for memory, rows in info.rows.items():
            for one in rows.segments:
                parts[f"checkpoints/rows/{file_name(memory, one)}"] = (ROWS_FORMAT, one.sha256)
        for part, (form, sha256) in parts.items():
            if part not in found:  # checkpoints share rows
                tensors_in(files.read(part, MOST_BYTES), run / part, form, sha256)
        MetricsFile(run / METRICS).verified(info.metrics_bytes, info.metrics_sha256)
        found |= {name, *parts}
    return found


def _info(data: bytes, path: Path) -> CheckpointInfo:
    try:
        return checkpoint_info(data)
    except ValueError as error:
        raise RunError(f"{path}: {error}") from error


def _damaged(
    reason: str, folder: Path | None = None, numbers: list[int] | None = None
) -> DamagedCheckpointError:
    if folder is None or numbers is None or len(numbers) < 2:
        return DamagedCheckpointError(reason)
    *_, before, newest = numbers
    return DamagedCheckpointError(
        f"{reason}; remove {folder / str(newest)} to go on from env-step {before:,}"
    )
