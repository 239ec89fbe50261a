"""The runs that a study needs, each with its configuration; it looks at no folder of runs."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from pathlib import Path
from typing import Any

from innerattn.config import SCENARIOS, RunConfig, load_run_config
from innerattn.config.run import digest_of
from innerattn.config.turning import check_frames
from innerattn.errors import ConfigError
from innerattn.experiments.plan import Case, of_seed
from innerattn.measures.registry import MEASURES
from innerattn.studies.space import Search, Value
from innerattn.studies.study import (
    ACTOR,
    RETAINED,
    UNSEEN,
    ActorAttention,
    Faults,
    Grid,
    Study,
    StudyContrast,
    UnseenTeams,
    Variant,
    coordinates,
)

SCORE_AS_SEEN = "score_as_seen"
TRAIN_SECONDS = "train_seconds"
TRAIN_CPU_SECONDS = "train_cpu_seconds"
TIMES = {TRAIN_SECONDS: "seconds", TRAIN_CPU_SECONDS: "cpu_seconds"}
"""What training took: a measure, and its name in the record of a run."""
MEASURES_OF_ALL = ("score", "rescues_per_episode", SCORE_AS_SEEN, *TIMES)
"""What every run has beside the registered measures."""
MOST_RUNS = 10_000
RECIPE = "recipe"
"""The trial of a search that changes nothing, as its variant is called."""
_NAMED_BY_THE_GRID = {"train.seed": "seeds", "train.method": "methods"}
_SECTION = {
    RETAINED: Faults.place,
    UNSEEN: UnseenTeams.place,
    f"{ACTOR}_": ActorAttention.place,
}
"""The section that adds a measure."""
_MEASURED = ("scenario", "evaluate")
"""Sections that say what is measured, so that no search may change them."""


@dataclass(frozen=True)
class PlannedRun:
    """A run of a study.

    Attributes:
        place: its coordinates in the grid but the seed: scenario, method, budget, variant if the
            study has variants, and each key that has several values in the grid.
        seed: of training.
        config: what it is trained and measured with.
        digest: of ``config``, by `run_digest`.
    """

    place: Mapping[str, Value]
    seed: int
    config: RunConfig
    digest: str

    @cached_property
    def key(self) -> str:
        """Its name in the ledger, which follows from its configuration alone."""
        train = self.config.train
        words = (self.config.scenario.situation, train.method, f"s{train.seed}")
        name = re.sub(r"[^A-Za-z0-9_-]", "_", "-".join(words))
        return f"{name}-{self.digest[:16]}"

    @property
    def case(self) -> Case:
        """What reports call it."""
        names = (str(self.place.get(key, "")) for key in ("scenario", "method", "variant"))
        scenario, method, variant = names
        return Case(scenario, method, self.seed, variant)

    def __str__(self) -> str:
        words = [str(value) for key, value in self.place.items() if key != "budget"]
        return f"{' '.join(filter(None, words))}, seed {self.seed}"


def run_digest(config: RunConfig) -> str:
    """The digest that tells runs apart: of a configuration, but for the device of its training.

    Raises:
        ConfigError: it depends on the machine how many workers train.
    """
    if config.train.workers == "auto":
        raise ConfigError("train.workers = 'auto': must be a number in a study")
    return digest_of(_on_any_device(config.digest_values()))


def _on_any_device(values: Mapping[str, Any]) -> dict[str, Any]:
    return {**values, "train": {**values["train"], "device": "cpu"}}


def plan_study(study: Study, find: Callable[[str], Path]) -> list[PlannedRun]:
    """The runs of a study, all of one seed before those of the next.

    Args:
        study: what is planned.
        find: where a scenario's file is, by its name in the study.

    Raises:
        ConfigError: there are over 10,000 runs, a combination cannot be run, two are the same run,
            a contrast names runs that are not in the grid, or values of a search cannot be run.
    """
    if study.search is not None:
        _refuse_unfit(study.search, study, find)
        return plan_trial(study, find, RECIPE, {})
    changes = {one.name: one.changes for one in study.variants}
    keys = [key for grid in study.grid for key in grid.keys]
    for key in (*keys, *(key for given in changes.values() for key in given)):
        if key in _NAMED_BY_THE_GRID:
            raise ConfigError(f"{key}: is set by grid.{_NAMED_BY_THE_GRID[key]}")
    scenarios = dict.fromkeys(name for grid in study.grid for name in grid.scenarios)
    for scenario in scenarios:
        _refuse_unknown(scenario, find)
    if len({Path(scenario).stem for scenario in scenarios}) < len(scenarios):
        raise ConfigError("grid.scenarios: two files have the same name; rename one")
    count = sum(math.prod(map(len, _axes(study, grid))) * len(grid.numbers) for grid in study.grid)
    if count > MOST_RUNS:
        raise ConfigError(f"grid: has {count:,} runs: must be at most {MOST_RUNS:,}")
    found = [(grid, list(_places(study, grid, changes, find))) for grid in study.grid]
    planned: dict[tuple[Any, ...], PlannedRun] = {}
    for seed in dict.fromkeys(seed for grid, _ in found for seed in grid.numbers):
        for runs in ([one.run(seed) for one in own] for grid, own in found if seed in grid.numbers):
            known = dict[tuple[str, Value], PlannedRun]()
            for run in runs:  # a variant may be what a budget is anyway
                named = run.key, run.place.get("variant", "")
                if (other := known.setdefault(named, run)) is not run:
                    raise ConfigError(f"grid: {run} and {other} are the same run")
                planned.setdefault((seed, *run.place.items()), run)  # several grids may have it
    for part in study.afterwards:
        if not any(part.takes(run.config) for run in planned.values()):
            raise ConfigError(f"{part.place}: must stand beside {part.needs}")
    places = list({tuple(run.place.items()): run.place for run in planned.values()}.values())
    for contrast in study.contrasts:
        _refuse_other_measure(
            f"contrasts, {contrast.name!r}: measure", contrast.measure, study, contrast.length
        )
        if contrast.measure_b is not None:
            where = f"contrasts, {contrast.name!r}: measure_b"
            _refuse_other_measure(where, contrast.measure_b, study, contrast.length)
        pairs(contrast, places)
    for shown in study.shown:
        where = f"{shown.place}, {shown.title!r}"
        refuse_other_coordinates(where, coordinates(shown.of, where), places)
    for table in study.tables:
        for measure, length in table.wanted:
            _refuse_other_measure(f"tables, {table.title!r}: measures", measure, study, length)
    return list(planned.values())


def plan_trial(
    study: Study, find: Callable[[str], Path], name: str, values: Mapping[str, Value]
) -> list[PlannedRun]:
    """The runs of one trial of a study with a search: of the seeds of the race, then the others.

    Args:
        study: what is planned.
        find: where a scenario's file is, by its name in the study.
        name: of the trial; its runs are those of a variant of this name.
        values: by dotted key of a run, beside what the grid says.

    Raises:
        ConfigError: the values cannot be run together.
    """
    assert study.search is not None
    seeds = (*study.grid[0].numbers, *study.search.confirm_seeds)
    trial = study.model_copy(
        update={
            "search": None,
            "grid": (study.grid[0].model_copy(update={"seeds": seeds}),),
            "variants": (Variant.of(name, values),),
        }
    )
    return plan_study(trial, find)


def _refuse_unfit(search: Search, study: Study, find: Callable[[str], Path]) -> None:
    """Refuse a search whose values cannot be run, each end of a range alone.

    Raises:
        ConfigError: the message names the key.
    """
    _refuse_other_measure("search.measure", search.measure, study, search.length)
    most = (search.trials + 1) * len(study.grid[0].numbers) * len(study.grid[0].scenarios)
    if most > MOST_RUNS:
        raise ConfigError(f"search: may need {most:,} runs: must be at most {MOST_RUNS:,}")
    for key, drawn in search.space.items():
        if key in _NAMED_BY_THE_GRID:
            raise ConfigError(f"search.{key}: is set by grid.{_NAMED_BY_THE_GRID[key]}")
        if key.partition(".")[0] in _MEASURED:
            raise ConfigError(f"search.{key}: must not change what is measured")
        for value in drawn.ends:
            try:
                plan_trial(study, find, "trial", {key: value})
            except ConfigError as error:
                why = error.__cause__ if isinstance(error.__cause__, ConfigError) else error
                raise ConfigError(f"search.{key} = {value!r}: {why}") from error


def _axes(study: Study, grid: Grid) -> list[Sequence[Any]]:
    """What a grid combines: scenarios, methods, budgets, names of variants, values of its keys."""
    every = tuple(one.name for one in study.variants)
    names = every if grid.variants is None else grid.variants
    return [grid.scenarios, grid.methods, grid.budgets, names or ("",), *grid.keys.values()]


def _places(
    study: Study,
    grid: Grid,
    changes: Mapping[str, Mapping[str, Any]],
    find: Callable[[str], Path],
) -> Iterator[_OfAllSeeds]:
    """The runs of a grid, without their seeds."""
    varied = [key for key in grid.keys if len({repr(one.keys.get(key)) for one in study.grid}) > 1]
    varied += [key for key, values in grid.keys.items() if len(values) > 1 and key not in varied]
    for scenario, method, budget, variant, *values in product(*_axes(study, grid)):
        chosen = dict(zip(grid.keys, values, strict=True))
        place = {"scenario": Path(scenario).stem, "method": method, "budget": budget}
        place |= {"variant": variant} if changes else {}
        place |= {key: value for key, value in chosen.items() if key in varied}
        given = {**chosen, **changes.get(variant, {})}
        try:
            config = _config(scenario, find, method, budget, {**of_seed(grid.numbers[0]), **given})
            check_frames(config)
        except ConfigError as error:
            named = ", ".join(f"{key} = {value}" for key, value in place.items() if value != "")
            raise ConfigError(f"grid ({named}): {error}") from error
        yield _OfAllSeeds(place, given, config, _on_any_device(config.digest_values()))


@dataclass(frozen=True)
class _OfAllSeeds:
    """The runs of one place, which differ in their seed alone.

    Attributes:
        place: as of `PlannedRun`.
        given: values by dotted key that the study gives all of them.
        first: configuration of the first one.
        values: what its digest is of.
    """

    place: Mapping[str, Value]
    given: Mapping[str, object]
    first: RunConfig
    values: Mapping[str, Any]

    def run(self, seed: int) -> PlannedRun:
        """The run with a seed, without checking anew all that does not depend on it."""
        sections: dict[str, dict[str, object]] = {}
        for key, value in of_seed(seed).items():
            section, name = key.split(".")
            if key not in self.given:
                sections.setdefault(section, {})[name] = value
        config = self.first.model_copy(
            update={
                section: getattr(self.first, section).model_copy(update=values)
                for section, values in sections.items()
            }
        )
        own = {section: self.values[section] | values for section, values in sections.items()}
        return PlannedRun(self.place, seed, config, digest_of({**self.values, **own}))


def pairs(
    contrast: StudyContrast, places: list[Mapping[str, Value]]
) -> list[tuple[Mapping[str, Value], Mapping[str, Value]]]:
    """The places of a contrast's two sides that are alike in all that neither side names.

    Args:
        contrast: what is compared.
        places: of the grid, each once.

    Raises:
        ConfigError: a side names what is not in the grid, or no two places belong together.
    """
    where = f"contrasts, {contrast.name!r}"
    sides = []
    for name, side in zip("ab", contrast.sides, strict=True):
        refuse_other_coordinates(f"{where}: {name}", side, places)
        sides.append([one for one in places if side.items() <= one.items()])
    free = set().union(*contrast.sides)
    others = {_rest(place, free): place for place in sides[1]}
    if len({_rest(place, free) for place in sides[0]}) < len(sides[0]):
        raise ConfigError(f"{where}: b names a key that a leaves open; name it in a, too")
    if len(others) < len(sides[1]):
        raise ConfigError(f"{where}: a names a key that b leaves open; name it in b, too")
    found = [(place, others[rest]) for place in sides[0] if (rest := _rest(place, free)) in others]
    if not found or (contrast.measure_b is None and any(a == b for a, b in found)):
        raise ConfigError(f"{where}: a and b must be different runs of the grid")
    return found


def refuse_other_coordinates(
    where: str, named: Mapping[str, Value], places: Iterable[Mapping[str, Value]]
) -> None:
    """Refuse coordinates that no place of the grid has.

    Raises:
        ConfigError: there is one; the message begins with ``where``.
    """
    every = list(places)
    for key, value in named.items():
        values = list(dict.fromkeys(place[key] for place in every if key in place))
        if value not in values:
            of = f"must be one of {', '.join(map(repr, values))}" if values else "is no key"
            raise ConfigError(f"{where}.{key} = {value!r}: {of} of the grid")


def _refuse_other_measure(where: str, measure: str, study: Study, length: str) -> None:
    if measure in study.measures and length != "standard":
        raise ConfigError(f"{where} = {measure!r}: has no value of long episodes")
    if measure not in (*MEASURES_OF_ALL, *MEASURES, *study.measures):
        known = ", ".join((*MEASURES_OF_ALL, *MEASURES, *study.measures))
        sections = [one for name, one in _SECTION.items() if measure.startswith(name)]
        missing = [one for one in sections if getattr(study, one) is None]
        needs = f"; it needs [{missing[0]}]" if missing else ""
        raise ConfigError(f"{where} = {measure!r}: must be one of {known}{needs}")


def _rest(place: Mapping[str, Value], free: set[str]) -> tuple[tuple[str, Value], ...]:
    return tuple((key, value) for key, value in place.items() if key not in free)


def _refuse_unknown(scenario: str, find: Callable[[str], Path]) -> None:
    if scenario not in SCENARIOS and not scenario.endswith(".toml"):
        raise ConfigError(
            f"grid.scenarios: {scenario!r}: must be a TOML file or one of {', '.join(SCENARIOS)}"
        )
    if scenario.endswith(".toml") and not find(scenario).exists():
        raise ConfigError(f"grid.scenarios: cannot read {find(scenario)}: No such file")


def _config(
    scenario: str,
    find: Callable[[str], Path],
    method: str,
    budget: str,
    overrides: Mapping[str, object],
) -> RunConfig:
    if scenario in SCENARIOS:
        return load_run_config(scenario, method, budget, overrides=overrides)
    path = find(scenario)
    return load_run_config("mixed", method, budget, overrides=overrides, scenario_file=path)
