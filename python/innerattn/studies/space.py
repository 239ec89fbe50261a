"""The part of a study's file that asks for a search: its values, and the rules of the race."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any, ClassVar, Literal, Self

from pydantic import ConfigDict, Field, ValidationError, field_validator, model_validator

from innerattn.config.model import Model, config_error
from innerattn.studies.seeds import listed_seeds

Value = str | int | float | bool
Length = Literal["standard", "long"]
MOST_TRIALS = 1_000


class Range(Model):
    """The values of a key of a run from which a search draws: all between two ends."""

    place: ClassVar[str] = "search"

    low: int | float = Field(description="least value")
    high: int | float = Field(description="largest value; whole numbers where both ends are")
    log: bool = Field(False, description="whether ratios count instead of differences")

    @model_validator(mode="after")
    def _check(self) -> Self:
        if not self.low < self.high:
            raise ValueError(f"high = {self.high}: must be above low = {self.low}")
        if self.log and self.low <= 0:
            raise ValueError(f"low = {self.low}: must be above 0 where log = true")
        return self

    @property
    def whole(self) -> bool:
        """Whether its values are whole numbers."""
        return isinstance(self.low, int) and isinstance(self.high, int)

    @property
    def ends(self) -> tuple[Value, ...]:
        """Its outermost values."""
        return self.low, self.high

    def __contains__(self, value: object) -> bool:
        """Whether a value may be drawn from it."""
        if not isinstance(value, int | float) or isinstance(value, bool):
            return False
        return self.low <= value <= self.high and (not self.whole or float(value).is_integer())


class Choice(tuple[Value, ...]):
    """The values of a key of a run from which a search draws: those of a list."""

    @property
    def ends(self) -> tuple[Value, ...]:
        """All of them."""
        return tuple(self)


class Search(Model):
    """A search for values of a run; sections of a run's configuration follow.

    Each of their keys has a list of values, or a table with the least and the largest one.
    """

    model_config = ConfigDict(extra="allow")
    place: ClassVar[str] = "search"

    trials: int = Field(30, ge=1, le=MOST_TRIALS, description="how many sets of values are tried")
    measure: str = Field(
        "score", description="score, rescues_per_episode or a registered measure of a run"
    )
    length: Length = Field("standard", description="length of the measured episodes")
    direction: Literal["maximize", "minimize"] = Field(
        "maximize", description="which values of the measure are better"
    )
    confirm: str | tuple[int, ...] = Field(
        (100, 101, 102),
        description="further seeds, with which the best trial is compared with the grid as it is",
    )
    margin: float = Field(
        0.03, gt=0.0, description="differences that are smaller count as none in that comparison"
    )

    @field_validator("confirm")
    @classmethod
    def _listed(cls, given: str | tuple[int, ...]) -> tuple[int, ...]:
        return listed_seeds(given, "search.confirm")

    @model_validator(mode="after")
    def _check(self) -> Self:
        if not self.space:
            raise ValueError("search: must name a key of a run, such as ppo.learning_rate")
        return self

    @property
    def confirm_seeds(self) -> tuple[int, ...]:
        """The further seeds."""
        assert not isinstance(self.confirm, str)  # it was listed
        return self.confirm

    @property
    def space(self) -> dict[str, Range | Choice]:
        """What is drawn from, by dotted key of a run."""
        return dict(_leaves(self.model_extra or {}, ()))


def _leaves(
    sections: Mapping[str, Any], above: tuple[str, ...]
) -> Iterator[tuple[str, Range | Choice]]:
    for key, value in sections.items():
        name = ".".join((*above, key))
        if isinstance(value, Mapping) and not {"low", "high"} & value.keys():
            yield from _leaves(value, (*above, key))
        elif not above:
            raise ValueError(
                f"search.{key}: unknown key; a run's keys are written SECTION.KEY = "
                "{ low = ..., high = ... } or with a list of values"
            )
        elif isinstance(value, Mapping):
            try:
                yield name, Range.model_validate(value)
            except ValidationError as error:
                refused = config_error(error, source="", model=Range)
                raise ValueError(f"search.{name}: {str(refused).lstrip(': ')}") from error
        else:
            yield name, _choice(name, value)


def _choice(name: str, values: object) -> Choice:
    if not isinstance(values, list) or len(values) < 2:
        raise ValueError(
            f"search.{name} = {values!r}: must be a list of two values or more, or "
            "{ low = ..., high = ... }"
        )
    for one in values:
        if not isinstance(one, str | int | float) or (
            isinstance(one, float) and not math.isfinite(one)
        ):
            raise ValueError(f"search.{name}: {one!r}: must be a text, a number, true or false")
    if len({repr(one) for one in values}) < len(values):
        raise ValueError(f"search.{name} = {values!r}: a value stands twice")
    return Choice(values)
