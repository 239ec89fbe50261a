"""A manifest for a run that has none: every file that has a reader is read and checked first."""

from __future__ import annotations

import os
import warnings
from dataclasses import dataclass, field
from pathlib import Path

from innerattn.config.untrusted import read_plain
from innerattn.errors import RunError, UnsealedRunWarning
from innerattn.experiments.plan import Case
from innerattn.experiments.run import measured_run
from innerattn.records.logged import METRICS, MOST_METRICS_BYTES, logged_lines
from innerattn.records.run_files import MANIFEST, RunFiles, seal, unsealed
from innerattn.records.run_folder import config_of
from innerattn.train import load_policy
from innerattn.train.resume import verify_checkpoints
from innerattn.train.run_lock import only_training_in
from innerattn.train.weights import MOST_BYTES, weights_in


@dataclass
class Sealed:
    """What was sealed.

    Attributes:
        files: names of all files in the manifest, sorted.
        bytes: their size together.
        checked: what was read and checked, as text.
        unread: names of files that nothing reads; they were sealed as they are.
    """

    files: list[str] = field(default_factory=list)
    bytes: int = 0
    checked: list[str] = field(default_factory=list)
    unread: list[str] = field(default_factory=list)


def seal_run(run: Path) -> Sealed:
    """Write the manifest of a run that is over and has none.

    Nothing is written unless every file that has a reader can be read.

    Raises:
        RunError: the run has a manifest, is in training, was killed, or lacks a file; a file is
            damaged or does not fit the others; something in the folder is no plain file or folder.
        ConfigError: its configuration is not valid.
        OSError: a file cannot be read, or the manifest cannot be written.
    """
    with only_training_in(run), unsealed(run), warnings.catch_warnings():
        warnings.simplefilter("ignore", UnsealedRunWarning)
        files = RunFiles(run)
        if files.info.sealed:
            raise RunError(f"{run}: has a {MANIFEST} already")
        if files.info.state == "running":
            raise RunError(
                f"{run}: its training was killed; go on with: innerattn train --resume {run}"
            )
        sealed = Sealed(files=_plain_files(run))
        read = {"run.json", "config.toml"}
        config = config_of(files)
        sealed.checked.append("configuration")
        read |= _check_weights(files, sealed)
        read |= _check_metrics(files, sealed)
        if (run / "evaluation").exists():
            case = Case(config.scenario.situation, config.train.method, config.train.seed)
            records = measured_run(case, files, config, steps=True).read()
            sealed.checked.append(f"evaluation of {len(records)} records")
            names = ("summary.json", "episodes.parquet", "rescues.parquet")
            read |= {f"evaluation/{name}" for name in names}
        sealed.unread = [name for name in sealed.files if name not in read]
        seal(run, files.info)
    sealed.bytes = sum((run / name).stat().st_size for name in sealed.files)
    return sealed


def _plain_files(run: Path) -> list[str]:
    """Names of all files that a manifest is to hold.

    Raises:
        RunError: something is neither a plain file nor a folder.
    """
    names = []
    for folder, folders, files in os.walk(run):
        for name in (*folders, *files):
            path = Path(folder, name)
            if path.is_symlink() or not (path.is_dir() or path.is_file()):
                raise RunError(f"{path}: is neither a plain file nor a folder; remove it to seal")
            if path.is_file() and not name.startswith(".") and name != MANIFEST:
                names.append(path.relative_to(run).as_posix())
    return sorted(names)


def _check_weights(files: RunFiles, sealed: Sealed) -> set[str]:
    """Read all weights and checkpoints; their names."""
    run = files.path
    load_policy(run)
    found = verify_checkpoints(run)
    for path in sorted((run / "checkpoints").rglob("weights.safetensors")):
        found.add(path.relative_to(run).as_posix())
    found |= {
        f"checkpoints/{path.name}" for path in (run / "checkpoints").glob("best-*.safetensors")
    }
    weights = sorted(name for name in found if name.endswith(".safetensors"))
    for name in weights:
        if "/rows/" not in name and not name.endswith("state.safetensors"):
            weights_in(files.read(name, MOST_BYTES), run / name)
    sealed.checked.append(f"{len(weights)} files of weights and checkpoints")
    return found | {"checkpoints/latest"}


def _check_metrics(files: RunFiles, sealed: Sealed) -> set[str]:
    """Read all lines of metrics, if there are any; the file's name."""
    path = files.path / METRICS
    if not path.exists() and files.info.state == "interrupted":  # before its first line
        return set()
    data = read_plain(path, MOST_METRICS_BYTES)
    try:
        lines = [line["env_steps"] for line in logged_lines(data)]
    except (ValueError, KeyError, TypeError) as error:
        raise RunError(f"{path}: not the metrics of a run ({error})") from error
    if not lines or not data.endswith(b"\n") or lines != sorted(lines):
        raise RunError(f"{path}: is empty or cut, or its env_steps do not rise")
    if lines[-1] > files.info.env_steps:
        raise RunError(
            f"{path}: goes on to env-step {lines[-1]}, run.json to {files.info.env_steps}"
        )
    sealed.checked.append(f"{len(lines)} lines of metrics")
    return {METRICS}
