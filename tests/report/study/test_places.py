"""Names of the places of a grid: all differ, and say no more than they must."""

from hypothesis import given
from hypothesis import strategies as st

from innerattn.report.study.places import PlaceNames, varied_in
from innerattn.studies.space import Value

LONG = {"scenario": "crowd_3", "method": "ppo-inner", "train.env_steps": 400}
SHORT = {"scenario": "crowd_9", "method": "ppo-inner", "train.env_steps": 100}
SHORTER = {"scenario": "crowd_9", "method": "ppo-inner", "train.env_steps": 50}
NEAR = {**SHORT, "scenario.observed_teammates": 2}

PLACES = st.lists(
    st.fixed_dictionaries(
        {"scenario": st.sampled_from(["mixed", "double"]), "method": st.sampled_from(["a", "b"])},
        optional={
            "train.env_steps": st.integers(1, 3),
            "network.memory_width": st.integers(1, 3),
        },
    ),
    min_size=1,
    max_size=6,
    unique_by=lambda place: tuple(sorted(place.items())),
)


def names_of(places: list[dict[str, Value]]) -> list[str]:
    names, keys = PlaceNames(places), ["scenario", *varied_in(places)]
    return [names.name(place, list(dict.fromkeys(keys))) for place in places]


def test_a_key_stands_only_where_it_tells_places_apart() -> None:
    assert names_of([LONG, SHORT, SHORTER, NEAR]) == [
        "crowd_3",
        "crowd_9 [env_steps = 100]",
        "crowd_9 [env_steps = 50]",
        "crowd_9 [env_steps = 100, observed_teammates = 2]",
    ]
    assert names_of([LONG, SHORT]) == ["crowd_3", "crowd_9"]


def test_a_name_has_no_key_that_is_not_asked_for() -> None:
    names = PlaceNames([SHORT, SHORTER])
    assert names.name(SHORT, ["method"]) == "ppo-inner"
    assert names.name(SHORT, ["train.env_steps"]) == "env_steps = 100"


@given(PLACES)
def test_names_differ_as_places_do(places: list[dict[str, Value]]) -> None:
    assert len(set(names_of(places))) == len(places)
