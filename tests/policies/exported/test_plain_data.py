"""Readers of plain data: what they take, and what they say of the rest."""

import json
import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ConfigDict, TypeAdapter, ValidationError

from innerattn.policies.exported.contract import contract_in, contract_text, digest_of
from innerattn.policies.exported.plain_data import (
    flag,
    list_or_table,
    many,
    number,
    one_of,
    optional,
    pair,
    record,
    table,
    text,
    whole,
)


@dataclass(frozen=True)
class Thing:
    __pydantic_config__ = ConfigDict(extra="forbid", strict=True)

    name: str
    count: int
    size: float
    pairs: tuple[tuple[int, int], ...]
    amounts: tuple[str, ...] | dict[str, float]
    on: bool = False
    limit: float | None = None


THING = record(
    Thing,
    name=text(),
    count=whole(-(2**70), 2**70),
    size=number(),
    pairs=many(pair(whole(-(2**70), 2**70))),
    amounts=list_or_table(many(text()), table(number())),
    on=flag,
    limit=optional(number()),
)
LEAVES = st.none() | st.booleans() | st.integers(-9, 9) | st.floats(-9, 9) | st.sampled_from("ab")
VALUES = st.recursive(
    LEAVES,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.sampled_from("ab"), inner),
    max_leaves=4,
)
GOOD: dict[str, Any] = {
    "name": "a",
    "count": 1,
    "size": 2,
    "pairs": [[1, 2]],
    "amounts": {"water": 1.5},
}


@given(key=st.sampled_from([*Thing.__dataclass_fields__, "other"]), value=VALUES)
def test_the_same_is_taken_and_refused_as_by_an_independent_reader(key: str, value: Any) -> None:
    document = {**GOOD, key: value}
    try:
        wanted = TypeAdapter(Thing).validate_json(json.dumps(document))
    except ValidationError:
        with pytest.raises(ValueError, match=f"^{key}"):
            THING(document, "")
    else:
        found = THING(document, "")
        assert found == wanted
        assert repr(found) == repr(wanted)  # also the types of numbers


@pytest.mark.parametrize(
    ("reader", "value", "said"),
    [
        (text(), 3, "a.b: is 3: must be a text"),
        (text("[a-z]+", "small letters"), "ab\n", r"a.b: is 'ab\n': must be small letters"),
        (text(), "\ud800", r"a.b: is '\ud800': must be a text without halves of characters"),
        (one_of("x", "y"), "z", "a.b: is 'z': must be 'x' or 'y'"),
        (one_of(1), True, "a.b: is True: must be 1"),
        (flag, 1, "a.b: is 1: must be true or false"),
        (whole(1, 5), 5, "a.b: is 5: must be a whole number of at least 1 and below 5"),
        (whole(1), 1.0, "a.b: is 1.0: must be a whole number of at least 1"),
        (whole(0), True, "a.b: is True: must be a whole number of at least 0"),
        (number(above=0), 0, "a.b: is 0: must be a finite number above 0"),
        (number(least=0, most=1), 1.5, "a.b: is 1.5: must be a finite number at least 0 and at"),
        (number(least=0, below=1), 1, "a.b: is 1: must be a finite number at least 0 and below 1"),
        (number(), math.nan, "a.b: is nan: must be a finite number"),
        (number(), 10**400, "a.b: is 1000000"),
        (number(), "1", "a.b: is '1': must be a finite number"),
        (many(flag, 1), [], "a.b: has 0 entries: must have at least 1"),
        (many(flag, 1, 2), [True] * 3, "a.b: has 3 entries: must have at least 1 and at most 2"),
        (many(flag), [True, 2], "a.b.1: is 2: must be true or false"),
        (many(flag), "ab", "a.b: is 'ab': must be a list"),
        (table(flag), [], "a.b: is []: must be a table"),
        (table(flag), {"c": 0}, "a.b.c: is 0: must be true or false"),
        (table(flag, text("[a-z]", "a letter")), {"C": True}, "a.b: is 'C': must be a letter"),
    ],
)
def test_what_is_refused_is_named_with_its_place_and_what_it_must_be(
    reader: Callable[[Any, str], Any], value: Any, said: str
) -> None:
    with pytest.raises(ValueError) as caught:  # noqa: PT011 - the message is compared
        reader(value, "a.b")
    assert str(caught.value).startswith(said)
    assert "\n" not in str(caught.value)


def test_fields_are_those_of_the_dataclass() -> None:
    with pytest.raises(ValueError, match=r"^count: is missing$"):
        THING({"name": "a"}, "")
    with pytest.raises(ValueError, match=r"^other: is unknown; known are name, count, "):
        THING({**GOOD, "other": 1}, "")
    with pytest.raises(TypeError, match="Thing: has other fields than name"):
        record(Thing, name=text())


def changed(document: dict[str, Any], place: str, value: object) -> dict[str, Any]:
    """A copy with another value at a place; `KeyError` takes it away."""
    copy = json.loads(json.dumps(document))
    at = copy
    *path, last = [int(one) if one.isdigit() else one for one in place.split(".")]
    for one in path:
        at = at[one]
    if value is KeyError:
        del at[last]
    else:
        at[last] = value
    return copy


@pytest.mark.parametrize(
    ("place", "value"),
    [
        ("robots.0.mass_kg", 0.0),
        ("robots.0.mass_kg", "1"),
        ("robots.0.mass_kg", KeyError),
        ("robots.1.colour", "red"),
        ("robots.1.name", "../food"),
        ("robots.2.abilities", {"food": -1.0}),
        ("robots.2.drive", "legs"),
        ("robots.2.load", 0),
        ("observation.3.unit", None),
        ("actions.1.force", [1.0]),
        ("actions.1.number", 1.0),
        ("network.hidden_width", 4097),
        ("network.leaky_relu_slope", 1.0),
        ("network.encoder", "deep"),
        ("network.pooling", "sum"),
        ("damping", 1.5),
        ("observe_faults", 0),
        ("run.seed", 0.5),
        ("weights_sha256", "0" * 63),
        ("checked.observations", -1),
        ("arena_half_width_m", math.inf),
    ],
)
def test_a_contract_with_a_wrong_value_is_refused_by_its_place(
    plain_export: Path, place: str, value: object
) -> None:
    document = json.loads((plain_export / "contract.json").read_text())
    del document["sha256"]
    assert contract_in(contract_text(document)).robots[0].mass_kg == 1.0
    with pytest.raises(ValueError, match=rf"^{place}(\.\w+)?: (is|has) "):
        contract_text(changed(document, place, value))
    if value is not math.inf:  # which JSON does not hold
        wrong = changed(document, place, value)
        with pytest.raises(ValueError, match=rf"^{place}(\.\w+)?: (is|has) "):
            contract_in(json.dumps({**wrong, "sha256": digest_of(wrong)}).encode())
