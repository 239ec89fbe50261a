"""Places of a study's grid in words: what differs between them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from innerattn.studies.space import Value


class PlaceNames:
    """Names places by their coordinates, and by keys of a run where only those tell them apart."""

    def __init__(self, places: Sequence[Mapping[str, Value]]) -> None:
        """Take all places that are to be told apart."""
        alike: dict[frozenset[tuple[str, Value]], list[Mapping[str, Value]]] = {}
        for place in places:
            alike.setdefault(_coordinates(place), []).append(place)
        self._keys = {
            named: [key for key in varied_in(own) if "." in key] for named, own in alike.items()
        }

    def name(self, place: Mapping[str, Value], keys: Sequence[str]) -> str:
        """The name of one of the places, of some of its keys alone."""
        words = " ".join(str(place[key]) for key in keys if "." not in key and key in place)
        telling = self._keys[_coordinates(place)]
        of_runs = set_there(place, [key for key in keys if key in telling])
        return f"{words} [{of_runs}]" if words and of_runs else words or of_runs


def varied_in(places: Sequence[Mapping[str, Value]]) -> list[str]:
    """Keys that are not the same everywhere.

    Keys of a run that all places set are left out where they follow from scenario, method, budget
    and variant, such as a length of training for each scenario.
    """
    keys = dict.fromkeys(key for place in places for key in place)
    varied = [key for key in keys if len({place.get(key) for place in places}) > 1]
    named = [key for key in varied if "." not in key]
    return [key for key in varied if key in named or not _follows(key, named, places)]


def set_there(place: Mapping[str, Value], keys: Sequence[str]) -> str:
    """Those of some keys that a place sets, by the last part of their names."""
    return ", ".join(f"{key.rpartition('.')[2]} = {place[key]}" for key in keys if key in place)


def named_values(place: Mapping[str, Value], varied: Sequence[str]) -> list[str]:
    """What differs of a place; a grid may leave out what another one sets."""
    return [str(place.get(key, "default")) for key in varied]


def _coordinates(place: Mapping[str, Value]) -> frozenset[tuple[str, Value]]:
    """Scenario, method, budget and variant of a place."""
    return frozenset((key, value) for key, value in place.items() if "." not in key)


def _follows(key: str, named: Sequence[str], places: Sequence[Mapping[str, Value]]) -> bool:
    """Whether all places set a key, and to one value where they agree in the coordinates named."""
    if any(key not in place for place in places):
        return False
    agreeing: dict[tuple[Value | None, ...], set[Value]] = {}
    for place in places:
        agreeing.setdefault(tuple(map(place.get, named)), set()).add(place[key])
    return all(len(values) == 1 for values in agreeing.values())
