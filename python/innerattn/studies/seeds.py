"""Seeds as a study's file lists them."""

from __future__ import annotations

import re

MOST_SEEDS = 1_000
_RANGE = re.compile(r"([0-9]{1,18})\.\.([0-9]{1,18})")
_MOST_SEED = 2**62


def listed_seeds(given: str | tuple[int, ...], where: str) -> tuple[int, ...]:
    """The seeds of a list, or of a range with both ends as text, such as "0..4".

    Raises:
        ValueError: there are none or over 1,000, or one is out of range; it begins with ``where``.
    """
    if isinstance(given, str):
        match = _RANGE.fullmatch(given)
        if match is None:
            raise ValueError(f"{where} = {given!r}: must be a range such as '0..4'")
        first, last = int(match[1]), int(match[2])
        seeds = tuple(range(first, min(last + 1, first + MOST_SEEDS + 1)))
    else:
        seeds = given
    if not 1 <= len(seeds) <= MOST_SEEDS:
        raise ValueError(f"{where} = {given!r}: must be 1 to {MOST_SEEDS:,} seeds")
    for seed in seeds:
        if not 0 <= seed <= _MOST_SEED:
            raise ValueError(f"{where}: {seed}: must be in 0..={_MOST_SEED}")
    return seeds
