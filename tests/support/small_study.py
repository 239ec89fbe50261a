"""Shipped studies of runs that take a second each."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from innerattn.report.targets import TARGETS
from innerattn.studies.folder import StudyFolder, begin_study_in
from innerattn.studies.plan import PlannedRun, plan_study
from innerattn.studies.shipped import as_file, narrowed, shipped_table
from innerattn.studies.study import study_in

Command = Callable[..., int]
"""`innerattn reproduce` with small runs, as the fixture ``command`` has it."""


def with_values(table: Mapping[str, Any], values: Mapping[str, object]) -> dict[str, Any]:
    """A study all of whose runs have some values by dotted key."""
    grids = []
    for grid in table["grid"]:
        sections: dict[str, dict[str, object]] = {}
        for key, value in values.items():
            section, name = key.split(".")
            sections.setdefault(section, dict(grid.get(section, {})))[name] = [value]
        grids.append({**grid, **sections})
    return {**table, "grid": grids}


def planned_of(
    target: str,
    methods: Sequence[str] | None = None,
    scenarios: Sequence[str] | None = None,
    seeds: int = 1,
    budget: str = "short",
    values: Mapping[str, object] | None = None,
) -> list[PlannedRun]:
    """The runs of `innerattn reproduce` with these options."""
    found = TARGETS[target]
    table = narrowed(
        found.table,
        methods=methods or found.methods,
        scenarios=scenarios or found.situations,
        budget=budget,
        seeds=seeds,
    )
    data = as_file(with_values(table, values or {}))
    return plan_study(study_in(data, f"{target}.toml"), Path)


def begin_small(
    name: str, pool: Path, methods: Sequence[str], seeds: int, values: Mapping[str, object]
) -> StudyFolder:
    """A shipped study of budget quick in mixed, in a folder of its own in the pool."""
    table = narrowed(
        shipped_table(name), methods=methods, scenarios=("mixed",), budget="quick", seeds=seeds
    )
    data = as_file(with_values(table, values))
    return begin_study_in(data, Path(f"{name}.toml"), pool / "begun", pool=pool)


def run_in(pool: Path, method: str) -> Path:
    """The folder of the only run of a method in a pool."""
    (folder,) = (pool / "runs").glob(f"mixed-{method}-*")
    return folder


def times(folder: Path) -> dict[Path, int]:
    return {path: path.stat().st_mtime_ns for path in (folder, *folder.rglob("*"))}
