"""The runs of a study: their labels, what evaluation recorded of them, and what names them."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

from innerattn.config import RunConfig, read_toml
from innerattn.errors import RunError
from innerattn.records.parquet import read_records
from innerattn.records.record import Record
from innerattn.records.run_folder import newest_weights, plain_file, read_info
from innerattn.train.weights import digest_of


@dataclass(frozen=True)
class StudyRun:
    """A finished run with an evaluation in its folder.

    Attributes:
        situation: the worlds it was trained and measured in, such as "mixed".
        method: how it was trained, such as "td-inner".
        seed: of its training.
        folder: the run folder.
    """

    situation: str
    method: str
    seed: int
    folder: Path


@dataclass(frozen=True)
class Measured:
    """What evaluation recorded of a run.

    Attributes:
        run: which.
        recorded: the episodes that were recorded step by step.
        scored: all episodes of the standard length in order, those of ``recorded`` first.
        summary: the run folder's ``evaluation/summary.json``.
    """

    run: StudyRun
    recorded: Record
    scored: tuple[Record, ...]
    summary: dict[str, Any]


@dataclass(frozen=True)
class Digests:
    """SHA-256 of what a run was asked to do and of what it learnt, in hexadecimal.

    Attributes:
        config: of its configuration, see `innerattn.config.RunConfig.digest`.
        weights: of the newest weights, see `innerattn.train.weights.digest_of`.
    """

    config: str
    weights: str


def by_method(runs: Sequence[StudyRun]) -> dict[tuple[str, str], list[StudyRun]]:
    """Runs by situation and method, in the order these first appear; by seed within.

    Raises:
        RunError: there are none, or a situation, method and seed come twice.
    """
    if not runs:
        raise RunError("a study needs at least one run")
    groups: dict[tuple[str, str], list[StudyRun]] = {}
    for run in sorted(runs, key=lambda run: run.seed):
        groups.setdefault((run.situation, run.method), []).append(run)
    for group in groups.values():
        for first, second in pairwise(group):
            if first.seed == second.seed:
                raise RunError(
                    f"{first.folder} and {second.folder}: both are {first.situation}, "
                    f"{first.method}, seed {first.seed}; must be one run of each seed"
                )
    order = dict.fromkeys((run.situation, run.method) for run in runs)
    return {key: groups[key] for key in order}


def read_configs(runs: Sequence[StudyRun]) -> list[RunConfig]:
    """The runs' configurations, in their order.

    Raises:
        RunError: a run's label is not what its configuration says; runs of one situation and
            method were trained or measured differently, other than by their seed; or runs of one
            situation and seed were measured in different worlds, so that they are no pairs.
        ConfigError: a configuration cannot be read.
    """
    configs = [read_toml(plain_file(run.folder / "config.toml")) for run in runs]
    seen: dict[tuple[str, str], tuple[Path, dict[str, Any]]] = {}
    measured: dict[tuple[str, int], tuple[Path, int]] = {}
    for run, config in zip(runs, configs, strict=True):
        for name, label in (("method", run.method), ("seed", run.seed)):
            if getattr(config.train, name) != label:
                raise RunError(
                    f"{run.folder}: train.{name} = {getattr(config.train, name)!r}, "
                    f"but it is listed as {label!r}"
                )
        what = config.in_use()
        for free in ("seed", "threads", "device", "compile", "log_every_env_steps"):
            what["train"].pop(free)
        worlds = what["evaluate"].pop("seed")
        first = measured.setdefault((run.situation, run.seed), (run.folder, worlds))
        if worlds != first[1]:
            raise RunError(
                f"{run.folder} and {first[0]}: are of one seed, and evaluate.seed is {worlds} and "
                f"{first[1]}: must be the same worlds"
            )
        other, known = seen.setdefault((run.situation, run.method), (run.folder, what))
        if differing := [name for name in what if what[name] != known.get(name)]:
            raise RunError(
                f"{run.folder} and {other}: are listed as the same but for the seed, and differ "
                f"in {', '.join(differing)}"
            )
    return configs


def read_measured(run: StudyRun, *, step_by_step: bool = True) -> Measured:
    """What evaluation recorded of a run.

    Args:
        run: which.
        step_by_step: whether every step of ``recorded`` is needed; `kept.keep` leaves them out.

    Raises:
        RunError: there is no finished evaluation of the run's method in its folder.
    """
    folder = run.folder / "evaluation"
    try:
        summary = json.loads((folder / "summary.json").read_text("utf-8"))
    except (OSError, ValueError) as error:
        raise RunError(f"{folder / 'summary.json'}: no finished evaluation") from error
    own = [record for record in read_records(folder) if record.policy == run.method]
    scored: list[Record] = []
    for record in own:  # the longer episodes come last and begin at number 0 again
        if record.first_episode != sum(part.num_episodes for part in scored):
            break
        scored.append(record)
    if not scored or summary.get("method") != run.method:
        raise RunError(f"{folder}: holds no episodes of {run.method}")
    if step_by_step and not scored[0].steps:
        raise RunError(f"{folder}: holds no episodes of {run.method} recorded step by step")
    return Measured(run, scored[0], tuple(scored), summary)


def named_from(folder: Path, base: Path) -> str:
    """How a report in ``base`` names a run folder: from there, where it lies within."""
    within = folder.is_relative_to(base)
    return (folder.relative_to(base) if within else folder).as_posix()


def digests(folder: Path) -> Digests:
    """What tells the run in ``folder`` from any other.

    A run that was kept without its weights has the digest of theirs written down.

    Raises:
        RunError: a file is missing, is no plain file, or holds no whole weights.
        ConfigError: ``config.toml`` is not valid.
    """
    config = read_toml(plain_file(folder / "config.toml"))
    kept = None if os.path.lexists(folder / "checkpoints") else read_info(folder).weights_sha256
    return Digests(config.digest(), kept or digest_of(plain_file(newest_weights(folder))))
