"""The registry of measures, and what it computes of a policy's episodes."""

from dataclasses import replace

import pytest

from innerattn.config import Scenario
from innerattn.evaluate.play import run_episodes
from innerattn.measures import MEASURES, Measure, measure_of, measures_of, needed_fields, register
from innerattn.measures.dispatch_quality import dispatch_quality
from innerattn.measures.sharing.imbalance import workload_imbalance
from innerattn.measures.waiting import waiting
from innerattn.policies import scripted_policy
from innerattn.records.record import FIELDS, Record
from innerattn.stats import Estimate

SCENARIO = Scenario.preset("mixed")


@pytest.fixture(scope="module")
def record() -> Record:
    policy = scripted_policy("greedy", SCENARIO)
    return run_episodes(policy, SCENARIO, 60, 4, record=needed_fields(SCENARIO))


def split(record: Record, at: int) -> tuple[Record, Record]:
    """The first episodes with their steps, the others without."""
    first, rest = slice(at), slice(at, None)
    early = record.rescues["episode"] - record.first_episode < at
    return (
        replace(
            record,
            lengths=record.lengths[first],
            rescues=record.rescues[early],
            rewards_total=record.rewards_total[first],
            steps={name: values[first] for name, values in record.steps.items()},
        ),
        replace(
            record,
            first_episode=record.first_episode + at,
            lengths=record.lengths[rest],
            rescues=record.rescues[~early],
            rewards_total=record.rewards_total[rest],
            steps={},
        ),
    )


@pytest.fixture
def registry(monkeypatch: pytest.MonkeyPatch) -> dict[str, Measure]:
    """The registry, to be changed at will."""
    own = dict(MEASURES)
    monkeypatch.setattr("innerattn.measures.registry.MEASURES", own)
    return own


def test_every_measure_is_computed_and_says_what_it_is(record: Record) -> None:
    values = measures_of(record)
    assert list(values) == [name for name in MEASURES if MEASURES[name].applies(SCENARIO)]
    for name in values:
        measure = MEASURES[name]
        assert measure.name == name
        assert values[name] is not None, name
        assert isinstance(values[name], int) == measure.is_count
        assert measure.meaning
        assert "\n" not in measure.meaning


def test_values_are_those_of_their_functions(record: Record) -> None:
    values, choice, waited = measures_of(record), dispatch_quality(record), waiting(record)
    for name in ("choices", "sooner", "sooner_by_chance", "regret_s", "regret_by_chance_s"):
        assert values[name] == getattr(choice, name)
    for name in ("rescued", "left", "time_to_rescue_s", "time_per_rescue_s"):
        assert values[name] == getattr(waited, name)
    rescues = values["rescues_per_episode"]
    assert isinstance(rescues, Estimate)
    assert rescues.mean == record.rescue_counts().mean()
    assert values["imbalance"] == workload_imbalance(record)


def test_a_measure_is_over_the_episodes_that_have_what_it_needs(record: Record) -> None:
    first, rest = split(record, 20)
    values, whole, begin = measures_of(first, rest), measures_of(record), measures_of(first)
    for name in values:
        measure = MEASURES[name]
        assert values[name] == (begin if measure.needs else whole)[name]
        assert measure_of(name, first, rest) == values[name]
    nothing = measures_of(rest)
    assert all((nothing[name] is None) == bool(MEASURES[name].needs) for name in nothing)


def test_parts_that_both_have_steps_are_as_one(record: Record) -> None:
    first, rest = split(record, 20)
    steps = {name: values[20:] for name, values in record.steps.items()}
    assert measures_of(first, replace(rest, steps=steps)) == measures_of(record)


def test_parts_must_follow_each_other(record: Record) -> None:
    first, rest = split(record, 20)
    for wrong in (
        replace(rest, first_episode=21),
        replace(rest, policy="random"),
        replace(rest, seed=5),
        replace(rest, scenario=SCENARIO.replace(episode_steps=26)),
    ):
        with pytest.raises(ValueError, match="do not follow those of 'greedy', seed 4, up to 20"):
            measures_of(first, wrong)
    with pytest.raises(ValueError, match="at least one record"):
        measures_of()


def test_a_measure_that_is_registered_is_computed(
    record: Record, registry: dict[str, Measure]
) -> None:
    mine = Measure("steps", "", "length of all episodes", lambda r: int(r.lengths.sum()), ("obs",))
    assert register(mine) is registry["steps"] is mine
    assert "obs" in needed_fields(SCENARIO)
    assert measures_of(record)["steps"] is None  # observations were not recorded
    with pytest.raises(ValueError, match="'steps': is registered already"):
        register(mine)


def test_what_is_no_measure_is_refused() -> None:
    with pytest.raises(ValueError, match="'a b': name must be an identifier"):
        Measure("a b", "", "x", lambda _: None)
    with pytest.raises(ValueError, match=f"needs rescues; can be recorded: {FIELDS[0]}"):
        Measure("a", "", "x", lambda _: None, ("rescues",))
