"""A study as a file: which runs it compares, and the rules by which; it trains nothing."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import ConfigDict, Field, ValidationError, field_validator, model_validator

from innerattn.config.files import toml_table_in
from innerattn.config.model import Model, config_error
from innerattn.config.near import did_you_mean
from innerattn.config.run import digest_of
from innerattn.errors import ConfigError

_WORD = r"[A-Za-z0-9][A-Za-z0-9_.-]{0,63}"
_SEEDS = re.compile(r"([0-9]{1,18})\.\.([0-9]{1,18})")
_MOST_SEEDS = 1_000
_MOST_SEED = 2**62
_MOST_CONTRASTS = 200
_LONG = ", long"

Name = Annotated[str, Field(pattern=rf"^{_WORD}$")]
Value = str | int | float | bool
Direction = Literal["two-sided", "greater", "less"]
Length = Literal["standard", "long"]


class Grid(Model):
    """What the runs of a study are made of: each combination is a run.

    Sections of a run's configuration may follow, with a list of values for each of their keys.
    """

    model_config = ConfigDict(extra="allow")
    place: ClassVar[str] = "grid"

    scenarios: tuple[str, ...] = Field(
        ("mixed",), min_length=1, description="built-in scenarios, or TOML files with one"
    )
    methods: tuple[str, ...] = Field(
        ("ppo-inner",), min_length=1, description="values of train.method"
    )
    budgets: tuple[str, ...] = Field(("fast",), min_length=1, description="built-in recipes")
    seeds: str | tuple[int, ...] = Field(
        (0, 1, 2), description="seeds of training: a list, or a range with both ends as text"
    )
    variants: tuple[str, ...] | None = Field(
        None, description="names of variants that it is combined with, unless with all"
    )

    @field_validator("seeds")
    @classmethod
    def _listed(cls, given: str | tuple[int, ...]) -> tuple[int, ...]:
        if isinstance(given, str):
            match = _SEEDS.fullmatch(given)
            if match is None:
                raise ValueError(f"grid.seeds = {given!r}: must be a range such as '0..4'")
            first, last = int(match[1]), int(match[2])
            seeds = tuple(range(first, min(last + 1, first + _MOST_SEEDS + 1)))
        else:
            seeds = given
        if not 1 <= len(seeds) <= _MOST_SEEDS:
            raise ValueError(f"grid.seeds = {given!r}: must be 1 to {_MOST_SEEDS:,} seeds")
        for seed in seeds:
            if not 0 <= seed <= _MOST_SEED:
                raise ValueError(f"grid.seeds: {seed}: must be in 0..={_MOST_SEED}")
        return seeds

    @model_validator(mode="after")
    def _check(self) -> Self:
        listed: dict[str, tuple[Any, ...]] = {
            "scenarios": self.scenarios,
            "methods": self.methods,
            "budgets": self.budgets,
            "seeds": self.numbers,
            "variants": self.variants or (),
            **self.keys,
        }
        for key, values in listed.items():
            if (twice := _first_twice(values)) is not None:
                raise ValueError(f"grid.{key}: {twice!r} stands twice")
        return self

    @property
    def numbers(self) -> tuple[int, ...]:
        """The seeds."""
        assert not isinstance(self.seeds, str)  # it was listed
        return self.seeds

    @property
    def keys(self) -> dict[str, tuple[Value, ...]]:
        """Values by dotted key of a run, of the keys that the grid varies."""
        found = {}
        for key, values in _flat(self.model_extra or {}, "grid"):
            if not isinstance(values, list) or not values:
                raise ValueError(f"grid.{key} = {values!r}: must be a list of values")
            found[key] = tuple(values)
        return found


class Variant(Model):
    """A named change of runs; sections of a run's configuration follow its name."""

    model_config = ConfigDict(extra="allow")
    place: ClassVar[str] = "variants"

    name: Name = Field(description="a word of its own")

    @property
    def changes(self) -> dict[str, Any]:
        """Values by dotted key of a run."""
        return dict(_flat(self.model_extra or {}, f"variants, {self.name}"))


class StudyContrast(Model):
    """A difference a - b over the same seeds, and the rules by which it is judged."""

    place: ClassVar[str] = "contrasts"

    name: str = Field(min_length=1, max_length=100, description="what is asked, in a few words")
    a: dict[str, Any] = Field(
        min_length=1, description="which runs: variant, scenario, method, budget or a key, by value"
    )
    b: dict[str, Any] = Field(min_length=1, description="which runs they are compared with")
    measure: str = Field(
        "score", description="score, rescues_per_episode or a registered measure of a run"
    )
    length: Length | Literal["both"] = Field(
        "standard",
        description="length of the episodes: standard, long, or both, each with its own family",
    )
    margin: float = Field(gt=0.0, description="differences that are smaller count as none")
    direction: Direction = Field(
        "two-sided", description="hypothesis: a is another, a greater or a smaller value than b"
    )
    family: str = Field("all", description="contrasts whose p-values are adjusted together (Holm)")

    @property
    def lengths(self) -> tuple[Length, ...]:
        """The lengths of episodes at which it is judged."""
        return ("standard", "long") if self.length == "both" else (self.length,)

    @property
    def sides(self) -> tuple[dict[str, Value], dict[str, Value]]:
        """What a and b name, by coordinate of the grid."""
        return coordinates(self.a), coordinates(self.b)


class Shown(Model):
    """A part of the report."""

    title: str = Field(min_length=1, max_length=100, description="heading in the report")
    of: dict[str, Any] = Field(
        default_factory=dict, description="which runs: coordinates of the grid by value; none: all"
    )


class Curves(Shown):
    """A figure of rescues in training, against env-steps and time."""

    place: ClassVar[str] = "curves"


class StudyTable(Shown):
    """A table of means over seeds, a row for each place in the grid."""

    place: ClassVar[str] = "tables"

    measures: tuple[str, ...] = Field(
        ("rescues_per_episode", "score", "score, long"),
        min_length=1,
        max_length=8,
        description="score, rescues_per_episode or registered measures of a run; ', long' behind "
        "one means episodes of the second length",
    )
    seeds: bool = Field(True, description="whether the value of each seed is shown")

    @property
    def wanted(self) -> list[tuple[str, Length]]:
        """Its measures and their lengths of episodes."""
        return [
            (one.removesuffix(_LONG), "long" if one.endswith(_LONG) else "standard")
            for one in self.measures
        ]


SCORES = StudyTable(title="Scores")
"""The table of a study that lists none."""


class Study(Model):
    """A study: runs, and what is asked of them."""

    place: ClassVar[str] = "study"

    question: str = Field("", description="what the study asks, in a sentence; opens its report")
    grid: tuple[Grid, ...] = Field(
        default_factory=lambda: (Grid(),),
        min_length=1,
        max_length=20,
        description="what its runs are made of: one grid, or several",
    )
    variants: tuple[Variant, ...] = Field(
        (), description="named changes; each is combined with the whole grid"
    )
    contrasts: tuple[StudyContrast, ...] = Field(
        (), max_length=_MOST_CONTRASTS, description="what is compared"
    )
    tables: tuple[StudyTable, ...] = Field(
        (), max_length=20, description="what is shown as tables; none: rescues and scores of all"
    )
    curves: tuple[Curves, ...] = Field(
        (), max_length=20, description="what is shown as learning curves"
    )

    @field_validator("grid", mode="before")
    @classmethod
    def _one_or_several(cls, given: Any) -> Any:
        return (given,) if isinstance(given, Mapping) else given

    @model_validator(mode="after")
    def _check(self) -> Self:
        for what, names in (
            ("variants", [one.name for one in self.variants]),
            ("contrasts", [one.name for one in self.contrasts]),
            ("tables and curves", [one.title for one in self.shown]),
        ):
            if (twice := _first_twice(names)) is not None:
                raise ValueError(f"{what}: the name {twice!r} stands twice")
        known = [one.name for one in self.variants]
        for name in (name for grid in self.grid for name in grid.variants or ()):
            if name not in known:
                near = did_you_mean(name, known, repr)
                raise ValueError(f"grid.variants: {name!r}: must be the name of a variant{near}")
        return self

    @property
    def shown(self) -> tuple[Shown, ...]:
        """Its tables and curves."""
        return (*self.tables, *self.curves)

    def values(self) -> dict[str, Any]:
        """What its file says, as JSON values; one grid is a table, and what it lacks is absent."""
        values = self.model_dump(mode="json", exclude_none=True)
        for key in ("tables", "curves"):  # added later: where absent, digests are as before
            if not values[key]:
                del values[key]
        if len(self.grid) == 1:
            (values["grid"],) = values["grid"]
        return values

    def digest(self) -> str:
        """SHA-256, in hexadecimal, of its values; comments and order in its file do not count."""
        return digest_of(self.values())


def study_in(data: bytes, path: str | Path) -> Study:
    """The study in the bytes of the TOML file at ``path``.

    Raises:
        ConfigError: they are not TOML, or hold no valid study; the message names the key.
    """
    table = toml_table_in(data, path)
    try:
        return Study.model_validate(table)
    except ValidationError as error:
        refused = str(config_error(error, source=str(path), model=Study))
        if isinstance(table.get("grid"), Mapping):  # as the file has it
            refused = refused.replace("grid[0]", "grid")
        raise ConfigError(refused) from error


def _first_twice(values: Iterable[Any]) -> Any | None:
    """The first value that stands there a second time."""
    seen = set[str]()
    for one in values:
        if (text := repr(one)) in seen:
            return one
        seen.add(text)
    return None


def coordinates(side: Mapping[str, Any], where: str = "contrasts") -> dict[str, Value]:
    """Values by coordinate of the grid, whose keys of a run may be sections."""
    words = {key: value for key, value in side.items() if not isinstance(value, Mapping)}
    keys = {key: value for key, value in side.items() if isinstance(value, Mapping)}
    return words | dict(_flat(keys, where))


def _flat(sections: Mapping[str, Any], place: str) -> Iterator[tuple[str, Any]]:
    """Values by dotted key of sections, which may have sections themselves."""
    for section, values in sections.items():
        if not isinstance(values, Mapping):
            raise ConfigError(
                f"{place}: {section}: unknown key; a run's keys are written SECTION.KEY"
            )
        for key, value in values.items():
            if isinstance(value, Mapping):
                for last, inner in value.items():
                    yield f"{section}.{key}.{last}", inner
            else:
                yield f"{section}.{key}", value
