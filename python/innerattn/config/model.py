"""What all configuration models share: strict types, checked copies, digests, one-line errors."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Self, get_args

from pydantic import (
    BaseModel,
    ConfigDict,
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    ValidationError,
    ValidationInfo,
    field_validator,
    model_validator,
)
from pydantic.fields import FieldInfo
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, PydanticCustomError, core_schema

from innerattn.config.near import did_you_mean
from innerattn.errors import ConfigError

MOST_ROWS = 1_000_000_000
"""Upper limit of what is held in memory: far beyond what any machine holds."""
MOST_STEPS = 1_000_000_000_000_000
"""Upper limit of what is counted in steps."""


ADDED_LATER = "added later"
"""Annotates a key that came after runs had been published. At its default such a key is no part of
a digest, so that the digests of earlier runs stay what they were; its default must never change."""


@dataclass(frozen=True)
class OneOf:
    """Annotates a word that must be one of a list, which extensions may add to.

    Attributes:
        words: Gives the list when a value is checked.
    """

    words: Callable[[], Iterable[str]]

    def __get_pydantic_core_schema__(
        self, source: object, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        """Check the word after its type."""
        return core_schema.no_info_after_validator_function(self._check, handler(source))

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        """Offer today's words; another installation may know more."""
        plain = handler(schema)
        return {"anyOf": [{"enum": list(self.words())}, plain]}

    def _check(self, value: str) -> str:
        *others, last = (repr(word) for word in self.words())
        if repr(value) not in (*others, last):
            known = f"{', '.join(others)} or {last}"
            raise PydanticCustomError("word", "Input should be {known}", {"known": known})
        return value


@dataclass(frozen=True)
class Told:
    """The range of a number, or of the length of a list, that the compiled module checks.

    It tells readers and editors, and checks nothing itself.

    Attributes:
        low: the least value that is allowed.
        high: the largest.
    """

    low: float
    high: float

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        """Give the range to a number or a list, or to that of several types."""
        found = handler(schema)
        for one in found.get("anyOf", [found]):
            if one["type"] == "array":
                one |= {"minItems": self.low, "maxItems": self.high}
            elif one["type"] != "null":
                one.pop("exclusiveMaximum", None)
                one |= {"minimum": self.low, "maximum": self.high}
        return found


class Model(BaseModel):
    """A frozen model that refuses unknown keys, infinities, NaN and values of another type."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    place: ClassVar[str] = ""
    """What errors call an object of this class."""
    removed: ClassVar[Mapping[str, object]] = {}
    """Keys that runs had before they were removed, with the value that changed nothing. Such values
    are passed over, and stay in digests; others are refused."""

    @model_validator(mode="before")
    @classmethod
    def _pass_over_removed(cls, data: Any) -> Any:
        if not isinstance(data, Mapping) or not cls.removed.keys() & data.keys():
            return data
        for key, idle in cls.removed.items():
            if data.get(key, idle) != idle:
                raise ValueError(
                    f"{cls.place}.{key} = {data[key]!r}: must be left out, because it was removed; "
                    "a run that used it needs an earlier version of innerattn"
                )
        return {key: value for key, value in data.items() if key not in cls.removed}

    @field_validator("*", mode="before")
    @classmethod
    def _of_its_own_type(cls, value: object, info: ValidationInfo) -> object:
        """Refuse what pydantic would convert: true to 1, "25" to 25, 1 to true."""
        kinds = set(_types(cls.model_fields[str(info.field_name)].annotation))
        if bool in kinds and not isinstance(value, bool):
            raise PydanticCustomError("type", "Input should be true or false")
        parts = value if isinstance(value, (list, tuple)) else [value]
        others = any(isinstance(part, (bool, str)) for part in parts)
        words = str in kinds or any(isinstance(kind, str) for kind in kinds)
        if kinds & {int, float} and not words and others:
            what = "valid numbers" if parts is value else "a valid number"
            raise PydanticCustomError("type", f"Input should be {what}")
        return value

    def replace(self, **fields: object) -> Self:
        """A checked copy with some fields changed (`model_copy` does not check).

        Raises:
            ConfigError: unknown field or invalid value.
        """
        try:
            return self.model_validate(self.model_dump() | fields)
        except ValidationError as error:
            raise config_error(error, self.place, model=type(self)) from error


def values_for_digest(model: BaseModel) -> dict[str, Any]:
    """JSON values of a model by key, without keys `ADDED_LATER` that have their default.

    Keys that a `Model` has `removed` are among them.
    """
    known, values = type(model).model_fields, model.model_dump(mode="json")
    values |= model.removed if isinstance(model, Model) else {}
    for name, value in model:
        info = known.get(name)
        if info is not None and ADDED_LATER in info.metadata and value == _default(info):
            del values[name]
        elif isinstance(value, BaseModel):
            values[name] = values_for_digest(value)
        elif isinstance(value, tuple):
            values[name] = [
                values_for_digest(part) if isinstance(part, BaseModel) else given
                for part, given in zip(value, values[name], strict=True)
            ]
    return values


def _default(info: FieldInfo) -> object:
    make: Any = info.default_factory
    return info.default if make is None else make()


def _types(annotation: Any) -> Iterator[Any]:
    """The types that an annotation is made of."""
    yield annotation
    for part in get_args(annotation):
        yield from _types(part)


def config_error(
    error: ValidationError,
    root: str = "",
    source: str = "",
    model: type[BaseModel] | None = None,
) -> ConfigError:
    """A pydantic error in one line: place = value: what is allowed.

    Args:
        error: what pydantic raised.
        root: what places are inside of, e.g. "scenario".
        source: the file the values came from, if any.
        model: what was checked; the message names the key of it that an unknown one is like.

    Returns:
        An error that names the first ten places, each in at most some 400 letters.
    """
    lines: list[str] = []
    errors = error.errors(include_url=False)
    for item in errors[:_MOST_ERRORS]:
        location = item["loc"]
        place = _place([root, *location])
        if item["type"] == "value_error":  # our own rules name their place themselves
            lines.append(str(item["ctx"]["error"]))
        elif item["type"] == "extra_forbidden":
            near = "" if model is None else _meant_key(model, location)
            lines.append(f"{place}: unknown key{near}")
        elif item["type"] == "missing":
            lines.append(f"{place}: must be given")
        else:
            rule = item["msg"].replace("Input should be", "must be").replace("tuple", "list")
            near = _meant_word(item["input"], rule) if item["type"] in _OF_WORDS else ""
            lines.append(f"{place} = {item['input']!r}: {rule}{near}")
    lines = [_shortened(line) for line in lines]
    if len(errors) > _MOST_ERRORS:
        lines.append(f"and {len(errors) - _MOST_ERRORS:,} more")
    return ConfigError((f"{source}: " if source else "") + "; ".join(lines))


_MOST_ERRORS = 10
"""As many errors of one file are named."""
_MOST_LETTERS = 400


def _shortened(line: str) -> str:
    """A line of a message without the middle of what is long in it, e.g. a value."""
    half = _MOST_LETTERS // 2
    return line if len(line) <= 2 * half else f"{line[:half]} ... {line[-half:]}"


_OF_WORDS = ("literal_error", "word")
"""Types of errors whose message lists the words that are allowed, quoted."""


def _meant_word(value: object, rule: str) -> str:
    if not isinstance(value, str):
        return ""
    return did_you_mean(value, re.findall(r"'([^']+)'", rule), repr)


def _meant_key(model: type[BaseModel], location: Sequence[int | str]) -> str:
    """The key that was meant: one of the same name in another section, or one like it here."""
    *parents, last = location
    name = str(last)
    if len(parents) == 1:
        elsewhere = places_of_keys(model, without=str(parents[0]))
        if name in elsewhere:
            return f", did you mean {elsewhere[name]}?"
    here = [model]
    for part in parents:
        if isinstance(part, str):
            here = [inner for outer in here for inner in _models_of(outer, part)]
    return did_you_mean(name, [key for one in here for key in one.model_fields])


def places_of_keys(model: type[BaseModel], without: str = "") -> dict[str, str]:
    """Where the sections of a model have a key of a name: "td.gamma or ppo.gamma" by "gamma".

    Args:
        model: whose fields are sections.
        without: name of a section to leave out.
    """
    places: dict[str, list[str]] = {}
    for section in model.model_fields:
        if section != without:
            for key in dict.fromkeys(
                key for one in _models_of(model, section) for key in one.model_fields
            ):
                places.setdefault(key, []).append(f"{section}.{key}")
    return {key: " or ".join(found) for key, found in places.items()}


def _models_of(model: type[BaseModel], key: str) -> list[type[BaseModel]]:
    """The models that the value of a key may be made of."""
    info = model.model_fields.get(key)
    found = [] if info is None else list(_types(info.annotation))
    return [one for one in found if isinstance(one, type) and issubclass(one, BaseModel)]


def _place(location: Iterable[int | str]) -> str:
    text = ""
    for part in location:
        text += f"[{part}]" if isinstance(part, int) else f".{part}" if part else ""
    return text.removeprefix(".")
