"""TOML that may be hostile, under the limits of `innerattn.config.untrusted`."""

from __future__ import annotations

import re
import tomllib
from typing import Any

from innerattn.config.untrusted import MOST_DEPTH, refuse_deep

_MOST_KEYS = 20_000
_MOST_KEY_PARTS = 16
_QUOTED = re.compile(r'"(?:[^"\\\n]|\\[^\n])*+"|\'[^\'\n]*+\'')
_MANY_PARTS = re.compile(rf"(?<![\w-])[\w-]++(?:[ \t]*+\.[ \t]*+[\w-]++){{{_MOST_KEY_PARTS},}}")


def parse_toml(text: str) -> dict[str, Any]:
    """The table in a TOML text.

    Raises:
        ValueError: it is no TOML, or larger in some way than any configuration is.
    """
    if any(text.count(sign) > _MOST_KEYS for sign in "=[,"):
        raise ValueError(f"more than {_MOST_KEYS} keys, tables or values of lists")
    if _MANY_PARTS.search(_QUOTED.sub("q", text)):
        raise ValueError(f"a key of more than {_MOST_KEY_PARTS} parts")
    try:
        table = tomllib.loads(text)
    except RecursionError as error:
        raise ValueError(f"nested more than {MOST_DEPTH} deep") from error
    refuse_deep(table)
    return table
