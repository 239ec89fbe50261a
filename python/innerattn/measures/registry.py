"""All measures by name. A new one is a file of its own and one entry in `_BUILT_IN`.

Whatever is registered is computed in every evaluation, stored with it and shown in its tables.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import takewhile

from innerattn.config import Scenario
from innerattn.measures import (
    arrivals,
    deadlines,
    dispatch_quality,
    energy,
    helpers,
    loads,
    makespan,
    rescues,
    waiting,
)
from innerattn.measures.measure import Measure, Value
from innerattn.measures.sharing import imbalance
from innerattn.records.record import Record, joined

MEASURES: dict[str, Measure] = {}
"""The registered measures by name, in the order of tables; `register` adds one."""

_BUILT_IN = (
    rescues.RESCUES_PER_EPISODE,
    imbalance.IMBALANCE,
    *dispatch_quality.MEASURES,
    *waiting.MEASURES,
    *deadlines.MEASURES,
    *arrivals.MEASURES,
    *makespan.MEASURES,
    *helpers.MEASURES,
    *energy.MEASURES,
    *loads.MEASURES,
)


def register(measure: Measure) -> Measure:
    """Add a measure to `MEASURES`.

    Raises:
        ValueError: there is another one of its name.
    """
    if measure.name in MEASURES:
        raise ValueError(f"measure {measure.name!r}: is registered already")
    MEASURES[measure.name] = measure
    return measure


def needed_fields(scenario: Scenario) -> tuple[str, ...]:
    """What must be recorded step by step so that every measure of a scenario can be computed."""
    measures = (measure for measure in MEASURES.values() if measure.applies(scenario))
    return tuple(dict.fromkeys(name for measure in measures for name in measure.needs))


def measures_of(*parts: Record) -> dict[str, Value]:
    """All measures of one policy's episodes.

    A measure is computed over all episodes that have what it needs: with only the first 80 of 400
    episodes recorded step by step, waiting times are of those 80 and rescues of all 400.

    Args:
        parts: consecutive episodes of one policy in worlds of one scenario, seed and length, in
            order; at least one record.

    Returns:
        By the names of those `MEASURES` that apply to the scenario; None where no part has what a
        measure needs, or the episodes do not determine it.

    Raises:
        ValueError: the parts are not consecutive episodes of one policy.
    """
    _refuse_gaps(parts)
    scenario = parts[0].scenario
    measures = {name: one for name, one in MEASURES.items() if one.applies(scenario)}
    joined = {needs: _with_fields(parts, needs) for needs in {m.needs for m in measures.values()}}
    return {name: _value(measure, joined[measure.needs]) for name, measure in measures.items()}


def measure_of(name: str, *parts: Record) -> Value:
    """One measure of one policy's episodes; see `measures_of`.

    Raises:
        KeyError: no measure has this name.
        ValueError: the parts are not consecutive episodes of one policy.
    """
    measure = MEASURES[name]
    _refuse_gaps(parts)
    return _value(measure, _with_fields(parts, measure.needs))


def _value(measure: Measure, record: Record | None) -> Value:
    return None if record is None else measure.of(record)


def _refuse_gaps(parts: Sequence[Record]) -> None:
    if not parts:
        raise ValueError("parts: there must be at least one record")
    first = parts[0]
    episode = first.first_episode
    for part in parts:
        same = (part.policy, part.seed) == (first.policy, first.seed)
        if not same or part.scenario != first.scenario or part.first_episode != episode:
            raise ValueError(
                f"parts: episodes from {part.first_episode} of {part.policy!r}, seed {part.seed}, "
                f"do not follow those of {first.policy!r}, seed {first.seed}, up to {episode}"
            )
        episode += part.num_episodes


def _with_fields(parts: Sequence[Record], fields: tuple[str, ...]) -> Record | None:
    """One record of the first parts that have some fields step by step, with these alone."""
    having = list(takewhile(lambda part: all(name in part.steps for name in fields), parts))
    if not having:
        return None
    return joined(having, fields)


for _measure in _BUILT_IN:
    register(_measure)
