"""The lines of a training's metrics, and how many rescues one tells of."""

from __future__ import annotations

import io
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from innerattn.config import RunConfig
from innerattn.config.untrusted import parse_json

METRICS = "metrics.jsonl"
MOST_METRICS_BYTES = 1 << 30
"""Longest file of metrics that is read."""
_MOST_LINE_BYTES = 1 << 20


def logged_lines(data: bytes) -> Iterator[dict[str, Any]]:
    """The lines in the bytes of a ``metrics.jsonl``, one after the other.

    Raises:
        ValueError: a line is longer than 1 MiB, or no JSON, see `parse_json`.
    """
    for number, line in enumerate(io.BytesIO(data), 1):
        if len(line) > _MOST_LINE_BYTES:
            raise ValueError(
                f"line {number} has {len(line):,} bytes: must have at most {_MOST_LINE_BYTES:,}"
            )
        yield parse_json(line)


def logged_rescues(config: RunConfig, line: Mapping[str, Any]) -> float | None:
    """Rescues per training episode.

    Where a goal ends an episode, the episodes that ended are the lucky ones; all rescues are taken
    then, of as many env-steps of a world as its longest episode has.

    Args:
        config: of the run.
        line: of its ``metrics.jsonl``.

    Returns:
        None where no episode ended; in older runs whose episodes rescues end, the mean over the
        episodes that ended.
    """
    rate = line.get("rescues_per_env_step")
    if not config.training_scenario.ends_early or rate is None:
        found = line["rescues_per_episode"]
        return None if found is None else float(found)
    return float(rate) * config.training_scenario.episode_steps


def counts_as_evaluated(config: RunConfig) -> bool:
    """Whether `logged_rescues` counts over as much as an evaluation's standard episodes have."""
    longer = config.train.episode_steps not in (None, config.scenario.episode_steps)
    return not longer and not config.training_scenario.ends_early


def still_rises(rescues: Sequence[float]) -> bool:
    """Whether a course of training has not come to its end.

    The mean of its last quarter is above that of the quarter before by more than twice the standard
    error of their difference. Lines of a log depend on each other, so this is a hint and no test.

    Args:
        rescues: as `logged_rescues` counts them, in order; of fewer than 8 nothing can be said.
    """
    size = len(rescues) // 4
    if size < 2:
        return False
    before, last = np.array(rescues[-2 * size : -size]), np.array(rescues[-size:])
    error = math.sqrt((before.var(ddof=1) + last.var(ddof=1)) / size)
    return bool(last.mean() - before.mean() > 2.0 * error)


def unit_of_rescues(config: RunConfig) -> str:
    """What `logged_rescues` is counted over: "episode", or "N steps" where a goal ends episodes."""
    scenario = config.training_scenario
    return f"{scenario.episode_steps} steps" if scenario.ends_early else "episode"
