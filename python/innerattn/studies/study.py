"""A study as a file: which runs it compares, and the rules by which; it trains nothing."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import ConfigDict, Field, ValidationError, field_validator, model_validator

from innerattn.config.files import toml_table_in
from innerattn.config.model import Model, config_error
from innerattn.config.run import digest_of
from innerattn.errors import ConfigError

_WORD = r"[A-Za-z0-9][A-Za-z0-9_.-]{0,63}"
_SEEDS = re.compile(r"([0-9]{1,18})\.\.([0-9]{1,18})")
_MOST_SEEDS = 1_000
_MOST_SEED = 2**62
_MOST_CONTRASTS = 200

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
    length: Length = Field("standard", description="length of the episodes: standard or long")
    margin: float = Field(gt=0.0, description="differences that are smaller count as none")
    direction: Direction = Field(
        "two-sided", description="hypothesis: a is another, a greater or a smaller value than b"
    )
    family: str = Field("all", description="contrasts whose p-values are adjusted together (Holm)")

    @property
    def sides(self) -> tuple[dict[str, Value], dict[str, Value]]:
        """What a and b name, by coordinate of the grid."""
        return _coordinates(self.a), _coordinates(self.b)


class Study(Model):
    """A study: runs, and what is asked of them."""

    place: ClassVar[str] = "study"

    question: str = Field("", description="what the study asks, in a sentence; opens its report")
    grid: Grid = Field(default_factory=Grid, description="what its runs are made of")
    variants: tuple[Variant, ...] = Field(
        (), description="named changes; each is combined with the whole grid"
    )
    contrasts: tuple[StudyContrast, ...] = Field(
        (), max_length=_MOST_CONTRASTS, description="what is compared"
    )

    @model_validator(mode="after")
    def _check(self) -> Self:
        for what, names in (
            ("variants", [one.name for one in self.variants]),
            ("contrasts", [one.name for one in self.contrasts]),
        ):
            if (twice := _first_twice(names)) is not None:
                raise ValueError(f"{what}: the name {twice!r} stands twice")
        return self

    def digest(self) -> str:
        """SHA-256, in hexadecimal, of its values; comments and order in its file do not count."""
        values = self.model_dump(mode="json")
        return digest_of(values)


def study_in(data: bytes, path: str | Path) -> Study:
    """The study in the bytes of the TOML file at ``path``.

    Raises:
        ConfigError: they are not TOML, or hold no valid study; the message names the key.
    """
    table = toml_table_in(data, path)
    try:
        return Study.model_validate(table)
    except ValidationError as error:
        raise config_error(error, source=str(path), model=Study) from error


def _first_twice(values: Iterable[Any]) -> Any | None:
    """The first value that stands there a second time."""
    seen = set[str]()
    for one in values:
        if (text := repr(one)) in seen:
            return one
        seen.add(text)
    return None


def _coordinates(side: Mapping[str, Any]) -> dict[str, Value]:
    words = {key: value for key, value in side.items() if not isinstance(value, Mapping)}
    keys = {key: value for key, value in side.items() if isinstance(value, Mapping)}
    return words | dict(_flat(keys, "contrasts"))


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
