"""What a finished run's own evaluation found, read back from its folder."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from innerattn.config import RunConfig
from innerattn.errors import RunError
from innerattn.measures.summary import SCHEMA_VERSION
from innerattn.records.parquet import RECORD_FILES
from innerattn.records.run_folder import plain_file


class NotMeasuredError(RunError):
    """The evaluation of a run is not there as a whole."""


@dataclass(frozen=True)
class Scores:
    """What is scored at one length of episodes; ``score`` is none where it means nothing."""

    episode_steps: int
    rescues_per_episode: float
    score: float | None


def read_scores(folder: Path, config: RunConfig) -> tuple[Scores, Scores]:
    """What a run's evaluation found at the standard and at the second length of episodes.

    Args:
        folder: the run folder.
        config: the run's configuration.

    Raises:
        NotMeasuredError: a file of the evaluation is missing or damaged.
        RunError: a file is a link, or the run was measured otherwise than its configuration says,
            or by another version.
        OSError: a file cannot be read.
    """
    path = folder / "evaluation" / "summary.json"
    records = [path.with_name(name) for name in RECORD_FILES]
    for file in (path, *records):
        if not os.path.lexists(file):
            raise NotMeasuredError(f"{file}: missing")
    for file in records:
        _refuse_damaged(plain_file(file))
    try:
        found = json.loads(plain_file(path).read_text("utf-8"))
        _refuse_other_schema(path, found["schema_version"])
        parts = (found, found["long"])
        measured = tuple(
            Scores(
                int(part["episode_steps"]),
                float(part["rescues_per_episode"]["mean"]),
                None if part["score"] is None else float(part["score"]["mean"]),
            )
            for part in parts
        )
        _refuse_other_measures(path, found, config)
    except (ValueError, KeyError, TypeError, pa.ArrowException) as error:
        raise NotMeasuredError(f"{path}: not a whole evaluation") from error
    return measured[0], measured[1]


def _refuse_damaged(file: Path) -> None:
    file.open("rb").close()  # what cannot be read is an OSError, as is what arrow cannot decode
    try:
        pq.read_metadata(file)
    except (OSError, pa.ArrowException) as error:
        raise NotMeasuredError(f"{file}: not a whole Parquet file") from error


def _refuse_other_schema(path: Path, version: object) -> None:
    if version != SCHEMA_VERSION:
        raise RunError(f"{path}: schema_version = {version!r}: must be {SCHEMA_VERSION}")


def _refuse_other_measures(path: Path, found: dict[str, Any], config: RunConfig) -> None:
    settings, scenario = config.evaluate, config.scenario
    expected = {
        "method": (found["method"], config.train.method),
        "situation": (found["situation"], scenario.situation),
        "seed": (found["seed"], settings.seed),
        "episodes": (found["episodes"], settings.episodes),
        "episode_steps": (found["episode_steps"], scenario.episode_steps),
        "score_episodes": (
            found["score_episodes"],
            max(settings.score_episodes, settings.episodes),
        ),
        "long.episodes": (found["long"]["episodes"], settings.long_episodes),
        "long.episode_steps": (found["long"]["episode_steps"], settings.long_episode_steps),
    }
    for key, (value, wanted) in expected.items():
        if value != wanted:
            raise RunError(f"{path}: {key} = {value!r}, its configuration says {wanted!r}")
