"""Studies that are part of the package, as files, and parts of them with other seeds or budgets."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib.resources import files
from typing import Any

import tomli_w

from innerattn.config.files import toml_table_in

FOLDER = files("innerattn.studies.shipped")
_COORDINATES = {"scenario": "scenarios", "method": "methods", "budget": "budgets"}


def shipped_table(name: str) -> dict[str, Any]:
    """What the file of a shipped study says; it has a list of grids."""
    table = toml_table_in((FOLDER / f"{name}.toml").read_bytes(), f"{name}.toml")
    grids = table["grid"]
    return {**table, "grid": grids if isinstance(grids, list) else [grids]}


def narrowed(
    table: Mapping[str, Any],
    *,
    methods: Sequence[str],
    scenarios: Sequence[str],
    budget: str,
    seeds: int,
    device: str = "cpu",
) -> dict[str, Any]:
    """A study with other scenarios, budget and seeds in all its grids that share the first one's.

    Grids without a chosen method are left out, and those of scenarios of their own unless all
    scenarios and methods that they need are chosen. So are contrasts of runs that are left out.

    Args:
        table: as `shipped_table` gives it.
        methods: those that are chosen; the first grid may lack some.
        scenarios: those that are chosen.
        budget: name of a built-in recipe.
        seeds: how many: 0, 1, ...
        device: where networks are trained.
    """
    first = table["grid"][0]
    chosen = {"scenarios": [*scenarios], "budgets": [budget], "seeds": [*range(seeds)]}
    known = {method for grid in table["grid"] for method in grid["methods"]}
    whole = set(first["scenarios"]) <= set(scenarios)
    grids = []
    for number, grid in enumerate(table["grid"]):
        own = [
            one for one in methods if one in grid["methods"] or (not number and one not in known)
        ]
        alike = grid["scenarios"] == first["scenarios"]
        if own and (alike or (whole and set(grid["methods"]) <= set(methods))):
            shared = {key: new for key, new in chosen.items() if grid[key] == first[key]}
            grids.append({**grid, **shared, "methods": own})
    if device != "cpu":
        grids = [{**one, "train": {**one.get("train", {}), "device": [device]}} for one in grids]
    used = [name for grid in grids for name in grid.get("variants", ())]
    variants = [one for one in table.get("variants", ()) if not used or one["name"] in used]
    contrasts = [
        one
        for one in table.get("contrasts", ())
        if all(_is_there(one[side], grids) for side in "ab")
    ]
    return {**table, "grid": grids, "variants": variants, "contrasts": contrasts}


def _is_there(side: Mapping[str, Any], grids: Sequence[Mapping[str, Any]]) -> bool:
    """Whether some grid has what a side of a contrast names."""
    named = {_COORDINATES[key]: value for key, value in side.items() if key in _COORDINATES}
    return any(all(value in grid[key] for key, value in named.items()) for grid in grids)


def as_file(table: Mapping[str, Any]) -> bytes:
    """A study as the bytes of its file."""
    return tomli_w.dumps(table).encode()
