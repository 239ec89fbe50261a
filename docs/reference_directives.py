"""Directives of the reference pages, whose content follows from the program itself.

`{keys} module:Model` is a table of the keys of a model of configuration. `{command} NAME` is what
`innerattn NAME --help` prints, `{command} NAME --help-all` what that does.
"""

import json
import subprocess
import sys
from importlib import import_module
from typing import Any

from docutils import nodes
from pydantic import BaseModel
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

BEYOND_ALL = 2**32
"""The range of the core's counts, which says nothing to a reader."""
HEAD = ("key", "value", "default", "meaning")


def value_of(key: dict[str, Any], kinds: dict[str, Any]) -> str:
    """What a key takes, in words: its type and its range, or all its words."""
    if "$ref" in key:
        name = key["$ref"].rpartition("/")[2]
        return value_of(kinds[name], kinds) if "enum" in kinds[name] else name
    if "anyOf" in key:
        return " or ".join(value_of(one, kinds) for one in key["anyOf"])
    if "enum" in key:
        return ", ".join(map(str, key["enum"]))
    if "const" in key:
        return str(key["const"])
    if key.get("type") == "array":
        of = key.get("items") or next(iter(key.get("prefixItems", [])), {})
        return f"list of {value_of(of, kinds)}{length_of(key)}"
    name = {"null": "none", "boolean": "true or false"}.get(key.get("type", ""), key.get("type"))
    return ", ".join(filter(None, (str(name), range_of(key))))


def range_of(key: dict[str, Any]) -> str:
    """The range of a number: "0 to 1", "above 0 to 1", "0 to below 1", "at least 0", "above 0"."""
    low, high = key.get("minimum"), key.get("maximum")
    above, below = key.get("exclusiveMinimum"), key.get("exclusiveMaximum")
    below = None if below == BEYOND_ALL else below
    least = f"above {shown(above)}" if low is None and above is not None else shown(low)
    most = f"below {shown(below)}" if high is None and below is not None else shown(high)
    if least and most:
        return f"{least} to {most}"
    if least:
        return least if least.startswith("above") else f"at least {least}"
    return "" if not most else most if most.startswith("below") else f"at most {most}"


def length_of(key: dict[str, Any]) -> str:
    """How long a list may be, where readers choose its length."""
    low, high = key.get("minItems"), key.get("maxItems")
    return "" if high is None or low == high else f" ({low:g} to {high:g})"


def shown(value: float | None) -> str:
    """A number without needless zeros."""
    if value is None:
        return ""
    if value == 2**63:
        return "2**63"
    return f"{value:,.0f}" if value == int(value) else f"{value:.15f}".rstrip("0")


def default_of(name: str, key: dict[str, Any], required: list[str]) -> str:
    """The default as a TOML file has it."""
    if name in required:
        return "needed"
    if key.get("default") is None:
        return "none" if "default" in key else "the paper's"
    text = json.dumps(key["default"], ensure_ascii=False)
    return text if len(text) < 40 else "the paper's"


def rows_of(model: type[BaseModel]) -> list[tuple[str, str, str, str]]:
    """A row for each key of a model."""
    schema = model.model_json_schema()
    kinds, required = schema.get("$defs", {}), schema.get("required", [])
    return [
        (name, value_of(key, kinds), default_of(name, key, required), key.get("description", ""))
        for name, key in schema["properties"].items()
    ]


class Keys(SphinxDirective):
    """A table of the keys of a model."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """The table."""
        module, _, name = self.arguments[0].partition(":")
        rows = rows_of(getattr(import_module(module), name))
        group = nodes.tgroup("", *(nodes.colspec(colwidth=1) for _ in HEAD), cols=len(HEAD))
        group += nodes.thead("", row_of(HEAD))
        group += nodes.tbody("", *map(row_of, rows))
        return [nodes.table("", group, classes=["keys"])]


def row_of(cells: tuple[str, ...]) -> nodes.row:
    """A row of a table; the first cell is code."""
    first, *others = (nodes.paragraph("", cell) for cell in cells)
    if cells != HEAD:
        first = nodes.paragraph("", "", nodes.literal("", cells[0]))
    return nodes.row("", *(nodes.entry("", one) for one in (first, *others)))


class Command(SphinxDirective):
    """What a command prints as its help."""

    required_arguments = 1
    final_argument_whitespace = True

    def run(self) -> list[nodes.Node]:
        """The text."""
        words = self.arguments[0].split()
        words += [] if "--help-all" in words else ["--help"]
        command = [sys.executable, "-m", "innerattn", *words]
        environment = {"PATH": "/usr/bin:/bin", "COLUMNS": "80", "NO_COLOR": "1"}
        text = subprocess.run(command, capture_output=True, text=True, check=True, env=environment)
        return [nodes.literal_block("", text.stdout, language="none")]


def setup(app: Sphinx) -> dict[str, bool]:
    """Offer the directives."""
    app.add_directive("keys", Keys)
    app.add_directive("command", Command)
    return {"parallel_read_safe": True}
