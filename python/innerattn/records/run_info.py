"""What ``run.json`` says of a run: how it was made and how far it came."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Annotated, Any, Literal, get_args

from pydantic import ConfigDict, Field, StringConstraints, TypeAdapter, ValidationError

SCHEMA_VERSION = 1
State = Literal["running", "done", "interrupted"]

_Count = Annotated[int, Field(ge=0, lt=2**63)]
_Word = Annotated[str, StringConstraints(max_length=200)]


@dataclass(frozen=True)
class RunInfo:
    """How a run was made and how far it came; the contents of ``run.json``.

    ``weights_sha256`` is the digest of its newest weights, see `innerattn.train.weights.digest_of`;
    runs made before it was written down have none. ``sealed`` says that ``manifest.json`` holds
    the digests of all files, this one's too. ``resumed`` counts how often
    training went on from a checkpoint. ``cpu_seconds`` is the processor time of the training's
    process, of several workers the first one's; runs made before it was written down have none.
    """

    __pydantic_config__ = ConfigDict(extra="forbid", strict=True)

    schema_version: int
    versions: Annotated[dict[_Word, _Word], Field(max_length=100)]
    seed: Annotated[int, Field(ge=0, lt=2**64)]
    commit: Annotated[str, StringConstraints(pattern="^[0-9a-f]{40,64}$")] | None
    threads: Annotated[int, Field(ge=1, le=65_536)]
    device: _Word
    state: State
    env_steps: _Count
    updates: _Count
    seconds: Annotated[float, Field(ge=0, lt=1e12, allow_inf_nan=False)]
    compiled: bool = False
    matmul_backend: _Word = "default"
    warm_start: _Word = "none"
    weights_sha256: Annotated[str, StringConstraints(pattern="^[0-9a-f]{64}$")] | None = None
    sealed: bool = False
    resumed: _Count = 0
    cpu_seconds: Annotated[float, Field(ge=0, lt=1e12, allow_inf_nan=False)] | None = None


_CHECK = TypeAdapter(RunInfo)
_FORMER_KEYS = {"products": "matmul_backend"}
"""Keys of a ``run.json`` by the names that they had in older ones."""


def run_info(document: Any) -> RunInfo:
    """What the document of a ``run.json`` says.

    Raises:
        ValueError: it is not the record of a run, is of another version, or says what cannot be.
    """
    if not isinstance(document, dict) or "schema_version" not in document:
        raise ValueError("not the record of a run")
    if document["schema_version"] != SCHEMA_VERSION:
        version = document["schema_version"]
        raise ValueError(f"schema version {version}, only {SCHEMA_VERSION} is known")
    if document.get("state") not in get_args(State):
        raise ValueError(f"state {document.get('state')!r} is not one of {get_args(State)}")
    renamed = {_FORMER_KEYS.get(key, key): value for key, value in document.items()}
    try:
        return _CHECK.validate_json(json.dumps(renamed))  # strict, yet takes an object for it
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(map(str, first["loc"]))
        raise ValueError(f"not the record of a run: {place}: {first['msg']}") from error
