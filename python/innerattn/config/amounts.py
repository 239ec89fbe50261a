"""Abilities and needs: a list of names, or a table with an amount of each."""

from __future__ import annotations

from collections.abc import Mapping
from math import isfinite
from typing import Annotated, Any, NoReturn

from pydantic import AfterValidator, Strict
from pydantic_core import PydanticCustomError

from innerattn.config.model import Told


class _Amounts(dict[str, float]):
    """A table that cannot be changed, as everything in a scenario."""

    def __hash__(self) -> int:  # type: ignore[override]
        return hash(frozenset(self.items()))

    def __reduce__(self) -> Any:
        return type(self), (dict(self),)

    def _refuse(self, *_: object, **__: object) -> NoReturn:
        raise TypeError("amounts cannot be changed; replace makes a copy with others")

    __setitem__ = __delitem__ = __ior__ = _refuse
    clear = pop = popitem = setdefault = update = _refuse


Amounts = Annotated[
    dict[str, Annotated[float, Strict(), Told(1e-6, 1e6)]], AfterValidator(_Amounts)
]
"""Abilities with an amount of each."""


def list_or_table(value: object) -> object:
    """A value that is a list of names or a table of amounts; a validator of pydantic's."""
    if isinstance(value, Mapping):
        numbers = [one for one in value.values() if isinstance(one, (int, float))]
        fits = len(numbers) == len(value) and all(
            isfinite(one) and not isinstance(one, bool) for one in numbers
        )
    else:
        fits = isinstance(value, (list, tuple)) and all(isinstance(one, str) for one in value)
    if not fits:
        known = "Input should be a list of names, or a table of names with finite numbers"
        raise PydanticCustomError("type", known)
    return value


def in_words(abilities: tuple[str, ...] | Amounts) -> list[str]:
    """Abilities or needs for readers: names, or amounts and names."""
    if isinstance(abilities, dict):
        return [f"{amount:g} {name}" for name, amount in abilities.items()]
    return list(abilities)
