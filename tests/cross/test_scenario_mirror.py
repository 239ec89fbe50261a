"""The two descriptions of a scenario, pydantic's and the compiled one, name the same things."""

import json
from pathlib import Path
from typing import Literal, get_args, get_origin

import pytest
from pydantic import BaseModel, ValidationError

from innerattn import _core
from innerattn.config import (
    Arrival,
    Battery,
    Communication,
    Depot,
    Fault,
    Map,
    Obstacle,
    Robot,
    Scenario,
    Station,
    Task,
)
from innerattn.config.model import Told
from innerattn.envs.batch import FAULT_KINDS

ROBOT = {"name": "one", "kind": "any", "abilities": [], "max_speed_mps": 1.0, "mass_kg": 1.0}
OBSTACLE = {"shape": "disc", "radius_m": 0.1}
TASK = {"name": "task", "needs": ["food"]}
FAULT = {"robot": "food_0", "kind": "motor_gain", "value": 0.5}
ARRIVAL = {"at_s": 1.5, "task": "task_1", "position_m": [0.25, -0.5]}
STATION = {"position_m": [0.25, -0.5], "recharge_w": 5.0}
DEPOT = {"position_m": [0.25, -0.5]}
BATTERY = {"capacity_j": 10.0, "per_m_j": 2.0}
SENSOR = {"rays": 7, "range_m": 0.6, "field_of_view_deg": 90.0, "layers": ["ground", "air"]}
TEAM = Scenario().model_dump(mode="json")["robots"]
NESTED = {
    "robots": (Robot, ROBOT),
    "tasks": (Task, TASK),
    "obstacles": (Obstacle, OBSTACLE),
    "faults": (Fault, FAULT),
    "arrivals": (Arrival, ARRIVAL),
    "stations": (Station, STATION),
    "depots": (Depot, DEPOT),
}
CHOICES = [
    (name, get_args(field.annotation))
    for name, field in Scenario.model_fields.items()
    if get_origin(field.annotation) is Literal
]


def compiled(table: dict) -> dict:
    return json.loads(_core.Rules(json.dumps(table)).to_json())


def within(key: str, item: dict) -> dict:
    """A scenario with `item` in the list `key`; the default team stays so that tasks are served."""
    listed = {"situation": "listed"} if key == "arrivals" else {}
    if key == "stations":
        listed = {"robots": [{**TEAM[0], "battery": BATTERY}, *TEAM[1:]]}
    if key == "depots":
        listed = {"robots": [{**TEAM[0], "load": 2}, *TEAM[1:]]}
    return {key: [*TEAM, item] if key == "robots" else [item], **listed}


def test_defaults_agree_for_every_key_both_ways() -> None:
    ours, theirs = Scenario().model_dump(mode="json"), compiled({})
    assert ours.keys() == theirs.keys() == Scenario.model_fields.keys()
    for key, value in ours.items():
        assert (key, theirs[key]) == (key, value)


@pytest.mark.parametrize("key", NESTED)
def test_nested_keys_and_defaults_agree(key: str) -> None:
    model, item = NESTED[key]
    ours, theirs = model(**item).model_dump(mode="json"), compiled(within(key, item))[key][-1]
    assert ours == theirs
    assert ours.keys() == model.model_fields.keys()


@pytest.mark.parametrize("key", NESTED)
def test_required_keys_are_required_by_both(key: str) -> None:
    model, item = NESTED[key]
    required = {name for name, field in model.model_fields.items() if field.is_required()}
    for name in model.model_fields:
        if name == "radius_m" and key == "obstacles":
            continue  # a disc needs it, by a rule between values
        short = within(key, {k: v for k, v in item.items() if k != name})
        if name in required:
            with pytest.raises(ValueError, match=name):
                compiled(short)
            with pytest.raises(ValidationError, match=name):
                Scenario.model_validate(short)
        else:
            assert compiled(short) == Scenario.model_validate(short).model_dump(mode="json")


def test_choices_are_found() -> None:
    assert {name for name, _ in CHOICES} == {
        *("situation", "engine", "actions", "rescue_credit", "shaping", "victim_order"),
        "unavailable_robots",
    }


@pytest.mark.parametrize(("key", "values"), CHOICES)
def test_choices_agree(key: str, values: tuple[str, ...]) -> None:
    for value in values:
        assert compiled({key: value})[key] == value
    with pytest.raises(ValueError, match="unknown variant") as error:
        compiled({key: "another"})
    listed = set(str(error.value).split("`")[3::2])  # the compiled side lists what it knows
    assert listed == {*values}
    for wrong in (values[0].capitalize(), "", None, 0):
        with pytest.raises(ValueError, match="scenario"):
            compiled({key: wrong})
        with pytest.raises(ValidationError, match=key):
            Scenario.model_validate({key: wrong})


def test_kinds_of_faults_agree() -> None:
    kinds = get_args(Fault.model_fields["kind"].annotation)
    assert kinds == FAULT_KINDS == tuple(name for name, *_ in _core.FAULT_KINDS)
    for kind in kinds:
        assert compiled({"faults": [FAULT | {"kind": kind}]})["faults"][0]["kind"] == kind
    with pytest.raises(ValueError, match="unknown variant") as error:
        compiled({"faults": [FAULT | {"kind": "another"}]})
    assert set(str(error.value).split("`")[3::2]) == {*kinds}


@pytest.mark.parametrize("row", _core.FAULT_KINDS, ids=FAULT_KINDS)
def test_a_faults_value_is_in_its_range(row: tuple[str, str, float, float, float, str]) -> None:
    kind, unit, low, high, healthy, meaning = row
    described = str(Fault.model_fields["value"].description)
    assert f"{kind}: {meaning}" in described
    unit_shown = f" [{unit}]" if unit else ""
    assert f"{kind}: {meaning}, {low:.4g} to {high:.4g}{unit_shown}" in described
    for value in (low, high, healthy):
        assert compiled({"faults": [FAULT | {"kind": kind, "value": value}]})
    for value in (low - 0.01, high + 0.01):
        with pytest.raises(ValueError, match=rf"faults\[0\]\.value \({kind}\) = .*: must be"):
            compiled({"faults": [FAULT | {"kind": kind, "value": value}]})


def test_the_reference_names_every_fault_and_every_reward() -> None:
    text = (Path(__file__).parents[2] / "docs" / "scenario.md").read_text("utf-8")
    names = [row[0] for row in (*_core.FAULT_KINDS, *_core.REWARD_COMPONENTS)]
    assert [name for name in names if f"`{name}`" not in text] == []


def test_drives_agree() -> None:
    for drive in get_args(Robot.model_fields["drive"].annotation):
        table = {"robots": [*TEAM, {**ROBOT, "drive": drive}]}
        assert compiled(table) == Scenario.model_validate(table).model_dump(mode="json")
    with pytest.raises(ValueError, match="expected one of `force`, `velocity`, `unicycle`, `diff"):
        compiled({"robots": [*TEAM, {**ROBOT, "drive": "jet"}]})


def test_keys_of_communication_agree() -> None:
    ours = Scenario(communication=Communication()).model_dump(mode="json")["communication"]
    assert compiled({"communication": {}})["communication"] == ours
    for share in get_args(Communication.model_fields["share"].annotation):
        table = {"obstacles": [OBSTACLE], "occlusion": True, "communication": {"share": share}}
        assert compiled(table) == Scenario.model_validate(table).model_dump(mode="json")
    with pytest.raises(ValueError, match="expected `nothing` or `victims`"):
        compiled({"communication": {"share": "all"}})
    with pytest.raises(ValueError, match="unknown field `colour`"):
        compiled({"communication": {"colour": 1}})


def test_keys_of_a_map_agree() -> None:
    rows = ["#..", "...", "..#"]
    ours = Scenario(map=Map(rows=tuple(rows))).model_dump(mode="json")["map"]
    assert compiled({"map": {"rows": rows}})["map"] == ours
    with pytest.raises(ValueError, match="unknown field `colour`"):
        compiled({"map": {"rows": rows, "colour": 1}})


def test_shapes_agree() -> None:
    shapes = {"disc": {"radius_m": 0.1}, "box": {"half_extents_m": [0.1, 0.2]}}
    assert {*get_args(Obstacle.model_fields["shape"].annotation)} == shapes.keys()
    for shape, size in shapes.items():
        table = {"obstacles": [{"shape": shape, **size}]}
        assert compiled(table) == Scenario.model_validate(table).model_dump(mode="json")
    with pytest.raises(ValueError, match="expected `disc` or `box`"):
        compiled({"obstacles": [{"shape": "ring", "radius_m": 0.1}]})


@pytest.mark.parametrize("place", ["", *NESTED])
def test_an_unknown_key_is_refused_by_both(place: str) -> None:
    item = {**NESTED[place][1], "colour": 1} if place else {}
    table = within(place, item) if place else {"colour": 1}
    with pytest.raises(ValueError, match="unknown field `colour`") as error:
        compiled(table)
    assert "\n" not in str(error.value)
    with pytest.raises(ValidationError, match="colour"):
        Scenario.model_validate(table)


def test_every_value_survives_the_way_there_and_back() -> None:
    """Values that are no default: a key read under another name, or not at all, would differ."""
    changed = {
        "situation": "poisson",
        "robots": [
            *TEAM[1:],
            {**TEAM[0], "radius_m": 0.04, "drive_force_n": 3.5, "start_m": [0.25, -0.5]},
            {**TEAM[0], "name": "last", "battery": {**BATTERY, "idle_w": 0.25}, "load": 4},
            {**TEAM[0], "name": "drone", "drive": "velocity", "layer": "air", "sight_m": 0.75},
            {
                **{**TEAM[0], "name": "rover", "drive": "differential", "wheel_base_m": 0.07},
                **{"max_turn_rad_s": 3.0, "acceleration_m_s2": 2.0},
                "turn_acceleration_rad_s2": 9.0,
                "range_sensor": SENSOR,
                "field_of_view_deg": 200.0,
            },
        ],
        "tasks": [
            {
                **TASK,
                "service_s": 0.75,
                "service": "restart",
                "deadline_s": [1.5, 2.5],
                "after": ["other"],
                "arrival_rate_hz": 0.25,
                "area_m": [-1.5, -0.125, 1.25, 0.875],
            },
            {**TASK, "name": "other"},
        ],
        "max_victims": 7,
        "obstacles": [
            {
                "shape": "box",
                "half_extents_m": [0.1, 0.2],
                "position_m": [0.3, 0.4],
                "layers": ["air"],
            }
        ],
        "map": {"rows": ["####", "...#", "....", "...."], "layers": ["air"]},
        "occlusion": True,
        "communication": {"range_m": 0.5, "delay_steps": 3, "loss": 0.25, "share": "victims"},
        "stations": [{**STATION, "radius_m": 0.25}],
        "depots": [{**DEPOT, "radius_m": 0.375}],
        "arena_half_width_m": 2.0,
        "rescue_radius_m": 0.25,
        "spawn_clearance_m": 0.125,
        "wall_clearance_m": 0.0625,
        "victim_area_m": [-0.5, -0.25, 0.125, 0.75],
        "episode_steps": 99,
        "end_when_rescued": 4,
        "dt_s": 0.05,
        "substeps": 9,
        "damping": 0.5,
        "friction": 0.75,
        "actions": "continuous",
        "rescue_credit": "team",
        "rescue_reward": 3.0,
        "shaping": "potential",
        "shaping_weight": 0.5,
        "shaping_discount": 0.875,
        "contact_cost": 0.1,
        "action_cost": 0.2,
        "lost_cost": 0.3,
        "victim_order": "slot",
        "observed_teammates": 0,
        "faults": [{**FAULT, "onset_step": 3, "onset_rate_hz": 0.5, "duration_steps": 7}],
        "observe_faults": True,
        "unavailable_robots": "leave",
    }
    # Friction needs one engine, an area excludes a list of places, a rate one of arrivals and its
    # end, and the order of slots a number of victims.
    others = {"engine", "victim_places_m", "arrivals", "end_when_done", "observed_victims"}
    assert changed.keys() == Scenario.model_fields.keys() - others
    scenario = Scenario.model_validate(changed)
    default = Scenario()
    for key in changed:
        assert getattr(scenario, key) != getattr(default, key)
    assert compiled(changed) == scenario.model_dump(mode="json")
    few = {**changed, "victim_order": "relevant", "observed_victims": 1}
    assert compiled(few) == Scenario.model_validate(few).model_dump(mode="json")
    assert compiled(few)["observed_victims"] == 1
    del changed["victim_area_m"]
    listed = {**changed, "max_victims": 1, "victim_places_m": [[0.5, 0.25], [-1.5, 0.0]]}
    assert compiled(listed) == Scenario.model_validate(listed).model_dump(mode="json")
    assert compiled(listed)["victim_places_m"] == listed["victim_places_m"]
    arriving = {"situation": "listed", "arrivals": [ARRIVAL, {**ARRIVAL, "task": "task_2"}]}
    arriving["end_when_done"] = True
    assert compiled(arriving) == Scenario.model_validate(arriving).model_dump(mode="json")
    assert compiled(arriving)["arrivals"] == arriving["arrivals"]
    assert compiled(arriving)["end_when_done"]


def test_models_are_all_mirrored() -> None:
    inner = {
        argument
        for field in Scenario.model_fields.values()
        for argument in get_args(field.annotation)
        if isinstance(argument, type) and issubclass(argument, BaseModel)
    }
    assert inner == {model for model, _ in NESTED.values()} | {Communication, Map}


@pytest.mark.parametrize(
    ("model", "name"),
    [
        (model, name)
        for model in (Battery, Station, Depot)
        for name, field in model.model_fields.items()
        if field.metadata
    ],
)
def test_batteries_stations_and_depots_are_in_their_told_ranges(
    model: type[BaseModel], name: str
) -> None:
    (told,) = (one for one in model.model_fields[name].metadata if isinstance(one, Told))
    for value in (0.9 * told.low if told.low else -0.1, 1.1 * told.high):
        battery = BATTERY | ({name: value} if model is Battery else {})
        station = STATION | ({name: value} if model is Station else {})
        depot = DEPOT | ({name: value} if model is Depot else {})
        team = [{**TEAM[0], "battery": battery, "load": 2}, *TEAM[1:]]
        with pytest.raises(ValueError, match=rf"{name} = .*: must be in \S+\.\.=\S+"):
            compiled({"robots": team, "stations": [station], "depots": [depot]})
