"""Seeds as they are written on the command line: from text to numbers."""

from __future__ import annotations

import re

from innerattn.cli.options import UsageError

_MOST = 1_000
_PART = re.compile(r"([0-9]{1,19})(?:\.\.([0-9]{1,19}))?")
_FORM = "must be seeds from 0 on and ranges a..b with both ends, such as 0..4, 0,3,7 or 0..2,7"


def parse_seeds(text: str) -> tuple[int, ...]:
    """The seeds that ``text`` lists, in its order.

    Args:
        text: seeds and ranges that include both ends, with commas between: ``0..2,7``.

    Raises:
        UsageError: it lists none, something else, a seed twice or more seeds than anyone trains;
            the message names the value and what is allowed.
    """
    seeds: list[int] = []
    for part in text.split(","):
        match = _PART.fullmatch(part.strip())
        if match is None:
            raise UsageError(f"--seeds = {text!r}: {_FORM}")
        first, last = int(match[1]), int(match[2] or match[1])
        if last < first:
            raise UsageError(f"--seeds = {text!r}: {part.strip()} holds no seed; {_FORM}")
        if last - first >= _MOST - len(seeds):
            raise UsageError(f"--seeds = {text!r}: must be at most {_MOST:,} seeds")
        seeds += range(first, last + 1)
    for seed in seeds:
        if seeds.count(seed) > 1:
            raise UsageError(f"--seeds = {text!r}: holds {seed} more than once; {_FORM}")
    return tuple(seeds)
