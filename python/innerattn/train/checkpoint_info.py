"""What ``checkpoint.json`` says: how far a run was, and which files hold the rest."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass, field
from typing import Annotated, Any, Literal

from pydantic import ConfigDict, FailFast, Field, StringConstraints, TypeAdapter, ValidationError

from innerattn.config.untrusted import parse_json

SCHEMA_VERSION = 1
MOST_BYTES = 8 << 20
_MOST_KEYS = 1_000
Stage = Literal["imitating", "training"]

_Count = Annotated[int, Field(ge=0, lt=2**62)]
_Finite = Annotated[float, Field(allow_inf_nan=False)]
_Sha256 = Annotated[str, StringConstraints(pattern="^[0-9a-f]{64}$")]
_Name = Annotated[str, StringConstraints(pattern="^[a-z_.0-9]{1,64}$")]
_STRICT = ConfigDict(extra="forbid", strict=True)


@dataclass(frozen=True)
class Best:
    """The most rescues per env-step of some logging intervals, and the env-steps at their end."""

    __pydantic_config__ = _STRICT

    rescues_per_env_step: _Finite
    env_steps: _Count


@dataclass(frozen=True)
class Counters:
    """How far a run is.

    Attributes:
        stage: what it is doing.
        env_steps: all that are done, imitation included.
        stage_env_steps: those of the stage.
        learning: whether the last control step has still updates to do.
        step_metrics: what this control step has given so far, by name.
        stage_updates_before: updates that were done before the stage.
        stage_seconds_before: time before the stage [s].
        seconds: of training so far [s].
        best: what was best so far; None until enough env-steps were counted.
        counted_rescues: rescues that no comparison with the best has counted yet.
        counted_env_steps: the env-steps of these.
    """

    __pydantic_config__ = _STRICT

    stage: Stage = "imitating"
    env_steps: _Count = 0
    stage_env_steps: _Count = 0
    learning: bool = False
    step_metrics: dict[_Name, _Finite] = field(default_factory=dict)
    stage_updates_before: _Count = 0
    stage_seconds_before: Annotated[_Finite, Field(ge=0)] = 0.0
    seconds: Annotated[_Finite, Field(ge=0)] = 0.0
    best: Best | None = None
    counted_rescues: _Count = 0
    counted_env_steps: _Count = 0


@dataclass(frozen=True)
class Segment:
    """A file of rows: number of the first, how many, and the digest of its tensors."""

    __pydantic_config__ = _STRICT

    first: _Count
    count: Annotated[int, Field(ge=1, lt=2**40)]
    sha256: _Sha256


@dataclass(frozen=True)
class RowsInfo:
    """A memory whose rows lie in files: rows it has ever seen, and the files."""

    __pydantic_config__ = _STRICT

    seen: _Count
    segments: Annotated[tuple[Segment, ...], Field(max_length=50_000), FailFast()]


@dataclass(frozen=True)
class CheckpointInfo:
    """The contents of ``checkpoint.json``, but for its own digest."""

    __pydantic_config__ = _STRICT

    schema_version: int
    config_sha256: _Sha256
    counters: Counters
    weights_sha256: _Sha256
    state_sha256: _Sha256
    rows: dict[_Name, RowsInfo]
    metrics_bytes: _Count
    metrics_sha256: _Sha256


_CHECK = TypeAdapter(CheckpointInfo)


def checkpoint_text(info: CheckpointInfo) -> bytes:
    """The bytes of ``checkpoint.json``."""
    document = json.loads(json.dumps(asdict(info), allow_nan=False))
    document["sha256"] = _digest(document)
    return (json.dumps(document, indent=1) + "\n").encode()


def checkpoint_info(data: bytes) -> CheckpointInfo:
    """What the bytes of a ``checkpoint.json`` say.

    Raises:
        ValueError: they are damaged, of another version, or say what cannot be.
    """
    document: Any = parse_json(data)
    if not isinstance(document, dict) or "schema_version" not in document:
        raise ValueError("not a checkpoint")
    _refuse_many(document)
    if document["schema_version"] != SCHEMA_VERSION:
        version = document["schema_version"]
        raise ValueError(f"schema version {version}, only {SCHEMA_VERSION} is known")
    if document.pop("sha256", None) != _digest(document):
        raise ValueError("does not fit its own digest; it was altered")
    counters = document.get("counters")
    if isinstance(counters, dict) and "rescues_per_episode" in (counters.get("best") or {}):
        counters["best"] = None  # of an older version, in another unit: compare from here on
    try:
        return _CHECK.validate_json(json.dumps(document))
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(map(str, first["loc"]))
        raise ValueError(f"{place}: {first['msg']}") from error


def _refuse_many(document: dict[str, Any]) -> None:
    """Refuse more keys than a checkpoint has, before each of them is an error of its own."""
    level: list[Any] = [document]
    while level:
        for part in level:
            if len(part) > _MOST_KEYS:
                raise ValueError(f"{len(part):,} keys in one place: must be at most {_MOST_KEYS:,}")
        level = [one for part in level for one in part.values() if isinstance(one, dict)]


def _digest(document: dict[str, Any]) -> str:
    return hashlib.sha256(json.dumps(document, sort_keys=True).encode()).hexdigest()
