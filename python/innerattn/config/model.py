"""What all configuration models share: strictness, checked copies and one-line errors.

It knows no field of any model.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import ClassVar, Self

from pydantic import BaseModel, ConfigDict, ValidationError

from innerattn.errors import ConfigError


class Model(BaseModel):
    """A frozen model that refuses unknown keys, infinities and NaN."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    place: ClassVar[str] = ""
    """What errors call an object of this class."""

    def replace(self, **fields: object) -> Self:
        """A checked copy with some fields changed (`model_copy` does not check).

        Raises:
            ConfigError: unknown field or invalid value.
        """
        try:
            return self.model_validate(self.model_dump() | fields)
        except ValidationError as error:
            raise config_error(error, self.place) from error


def config_error(error: ValidationError, root: str = "", source: str = "") -> ConfigError:
    """A pydantic error in one line: place = value: what is allowed.

    Args:
        error: what pydantic raised.
        root: what places are inside of, e.g. "scenario".
        source: the file the values came from, if any.
    """
    lines = []
    for item in error.errors(include_url=False):
        place = _place([root, *item["loc"]])
        if item["type"] == "value_error":  # our own rules name their place themselves
            lines.append(str(item["ctx"]["error"]))
        elif item["type"] == "extra_forbidden":
            lines.append(f"{place}: unknown key")
        elif item["type"] == "missing":
            lines.append(f"{place}: must be given")
        else:
            rule = item["msg"].replace("Input should be", "must be")
            lines.append(f"{place} = {item['input']!r}: {rule}")
    return ConfigError((f"{source}: " if source else "") + "; ".join(lines))


def _place(location: Iterable[int | str]) -> str:
    text = ""
    for part in location:
        text += f"[{part}]" if isinstance(part, int) else f".{part}" if part else ""
    return text.removeprefix(".")
