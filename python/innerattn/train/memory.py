"""Whether the large memories of a training fit into what is free, before any of it is filled.

The system promises more memory than there is, and ends a process that makes use of the promise.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from innerattn.config import RunConfig
from innerattn.learn import workers
from innerattn.learn.ring import Ring

_KEYS = {
    "learner.replay": "td.replay_capacity",
    "imitation.labels": "imitation.memory_env_steps",
}
"""What sets the length of a ring, by its name in `innerattn.train.parts.Parts.rings`."""
_FREE = Path("/proc/meminfo")
_GIB = 2.0**30


def free_bytes(account: Path = _FREE) -> int | None:
    """Memory that processes can still take; None where the system does not tell."""
    try:
        lines = account.read_text("ascii").splitlines()
    except (OSError, ValueError):
        return None
    for line in lines:
        words = line.split()
        if len(words) == 3 and words[0] == "MemAvailable:" and words[2] == "kB":
            return 1024 * int(words[1])
    return None


def refuse_what_does_not_fit(rings: Mapping[str, Ring], config: RunConfig) -> None:
    """Refuse memories on the CPU that this run would fill and that are larger than what is free.

    Raises:
        MemoryError: the message names the key that sets the largest of them.
    """
    free = free_bytes()
    steps = config.train.env_steps + config.train.num_envs
    if config.train.warm_start != "none":
        steps += config.imitation.env_steps
    each = -(-steps // workers.count())
    needed = {
        name: min(ring.capacity, each) * ring.row_bytes * workers.count()
        for name, ring in rings.items()
        if all(column.device.type == "cpu" for column in ring.columns.values())
    }
    if free is None or sum(needed.values()) <= free:
        return
    name = max(needed, key=lambda one: needed[one])
    capacity = rings[name].capacity * workers.count()
    raise MemoryError(
        f"{_KEYS.get(name, name)} = {capacity}: takes {needed[name] / _GIB:,.1f} GiB; "
        f"{free / _GIB:,.1f} GiB are free"
    )
