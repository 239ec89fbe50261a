"""What the file ``contract.json`` of an exported team says, as checked plain data."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from typing import Annotated, Any, Literal

from pydantic import ConfigDict, Field, StringConstraints, TypeAdapter, ValidationError

from innerattn.config.untrusted import parse_json

FORMAT = "innerattn.export"
VERSION = 1
NAME = "contract.json"
WEIGHTS = "weights.safetensors"
CONTINUOUS_OUTPUTS = 4
"""Of a policy over forces: mean x and y, then log standard deviation x and y, before tanh."""

_Sha256 = Annotated[str, StringConstraints(pattern="^[0-9a-f]{64}$")]
_Name = Annotated[str, StringConstraints(pattern="^[A-Za-z0-9_-]{1,200}$")]
_File = Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9_-]{1,200}\.(onnx|safetensors)$")]
_Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
_Amounts = dict[str, _Positive]
_Share = Annotated[float, Field(ge=0, le=1)]
_Number = Annotated[float, Field(allow_inf_nan=False)]
_Index = Annotated[int, Field(ge=0, lt=2**20)]
_STRICT = ConfigDict(extra="forbid", strict=True)


@dataclass(frozen=True)
class Column:
    """One number of an observation: its name, unit, frame, and what a robot takes it from."""

    __pydantic_config__ = _STRICT

    name: str
    unit: str
    frame: str
    source: str


@dataclass(frozen=True)
class Action:
    """One action: its number, and the force [share of full force, x and y of the world]."""

    __pydantic_config__ = _STRICT

    number: _Index
    name: str
    force: tuple[_Number, _Number]


@dataclass(frozen=True)
class RangeRays:
    """A range sensor: rays from the robot's centre, and how far each reaches.

    The angles count from the robot's heading, or from the x axis for a robot without one,
    counterclockwise.
    """

    __pydantic_config__ = _STRICT

    rays: Annotated[int, Field(ge=1, le=360)]
    range_m: _Positive
    angles_rad: tuple[_Number, ...]


@dataclass(frozen=True)
class Member:
    """One robot of the team, and which actor is its policy.

    Attributes:
        drive: what its actions set: a force, a velocity, or on wheels the speed and the turn rate
            (unicycle) or the speeds of two wheels (differential).
        actions: the actions of a robot on wheels, where they are discrete; that of a unicycle
            sets shares of its speed and turn rate, that of a differential those of its wheels.
        max_turn_rad_s: of a robot on wheels.
        acceleration_m_s2: of a unicycle, or of each wheel of a differential.
        turn_acceleration_rad_s2: of a unicycle.
        track_m: between the wheels of a differential.
        sight_m: how far it sees; None: as far as the arena goes.
        field_of_view_deg: within which it sees, its middle straight ahead; None: all around.
        range_sensor: what measures the ``ranges`` of its readings.
        battery_j: capacity of its battery; it tells its ``charge`` as a share of it.
        load: its full load; it tells its ``load`` as a share of it.
    """

    __pydantic_config__ = _STRICT

    name: _Name
    kind: _Name
    abilities: tuple[str, ...] | _Amounts
    max_speed_mps: _Positive
    mass_kg: _Positive
    radius_m: _Positive
    drive_force_n: Annotated[float, Field(ge=0, allow_inf_nan=False)]
    actor: _Name
    drive: Literal["force", "velocity", "unicycle", "differential"] = "force"
    actions: tuple[Action, ...] = ()
    max_turn_rad_s: _Positive | None = None
    acceleration_m_s2: _Positive | None = None
    turn_acceleration_rad_s2: _Positive | None = None
    track_m: _Positive | None = None
    sight_m: _Positive | None = None
    field_of_view_deg: _Positive | None = None
    range_sensor: RangeRays | None = None
    battery_j: _Positive | None = None
    load: Annotated[int, Field(ge=1)] | None = None

    @property
    def has_wheels(self) -> bool:
        """Whether it drives along a heading."""
        return self.drive in ("unicycle", "differential")

    @property
    def stores(self) -> tuple[str, ...]:
        """What it has of ``charge`` and ``load``."""
        found = {"charge": self.battery_j, "load": self.load}
        return tuple(key for key, most in found.items() if most is not None)


@dataclass(frozen=True)
class NeededAbilities:
    """One kind of victim: the abilities that it needs, from a robot of its own each, or as sums."""

    __pydantic_config__ = _STRICT

    name: str
    needs: tuple[str, ...] | _Amounts


@dataclass(frozen=True)
class Entities:
    """Whose columns are whose: those of the robot, of each teammate, of each victim."""

    __pydantic_config__ = _STRICT

    own: _Index
    teammates: _Index
    teammate: _Index
    victims: _Index
    victim: _Index
    present: _Index


@dataclass(frozen=True)
class FrameColumns:
    """Columns that turn: pairs (x, y), those that change sign in a mirror, those that choose.

    Those of rays change places: ``ray_turns`` says for each element of the group which of them
    takes the place of each.
    """

    __pydantic_config__ = _STRICT

    vectors: tuple[tuple[_Index, _Index], ...]
    handed: tuple[_Index, ...]
    anchors: Annotated[tuple[tuple[_Index, _Index], ...], Field(min_length=1)]
    rays: tuple[_Index, ...] = ()
    ray_turns: tuple[tuple[_Index, ...], ...] = ()


@dataclass(frozen=True)
class LogStd:
    """Log standard deviations of outputs z: lowest + (highest - lowest) sigmoid(z + shift)."""

    __pydantic_config__ = _STRICT

    lowest: _Number
    highest: _Number
    shift: _Number


@dataclass(frozen=True)
class Network:
    """How the numbers of `weights.safetensors` make a policy; `log_std` of continuous actions."""

    __pydantic_config__ = _STRICT

    encoder: Literal["flat", "entities"]
    hidden_width: Annotated[int, Field(ge=1, le=4096)]
    leaky_relu_slope: Annotated[float, Field(ge=0, lt=1)]
    entities: Entities | None
    frame: FrameColumns | None
    log_std: LogStd | None = None


@dataclass(frozen=True)
class Checked:
    """What the check at the export found."""

    __pydantic_config__ = _STRICT

    observations: _Index
    same_greedy_action: Annotated[int, Field(ge=0)]
    near_ties: Annotated[int, Field(ge=0)]
    largest_difference_onnx: _Number
    largest_difference_numpy: _Number


@dataclass(frozen=True)
class FileEntry:
    """A file of the folder: its SHA-256 and size."""

    __pydantic_config__ = _STRICT

    sha256: _Sha256
    bytes: Annotated[int, Field(ge=0, lt=2**40)]


@dataclass(frozen=True)
class Contract:
    """The contents of ``contract.json``, but for its own digest.

    Attributes:
        format: `FORMAT`.
        version: `VERSION`.
        about: rules in sentences, by subject.
        made_with: versions of libraries.
        run: where the team comes from: method, seed, env_steps, digests.
        scenario: all keys of the worlds that it was trained for.
        scenario_sha256: that of the scenario as JSON with sorted keys, without spaces.
        control_period_s: from one action to the next [s].
        damping: share of the velocity that is lost in a control period.
        arena_half_width_m: half the side of the arena [m].
        victim_order: as in the scenario.
        victim_slots: most victims that an observation holds.
        observe_faults: whether the columns of faults are there.
        max_age_s: how old a reading may be, if nothing else is asked for [s].
        greedy_actions: whether the likeliest action is to be taken, instead of a drawn one.
        abilities: all of them, in the order of columns.
        tasks: kinds of victims.
        robots: the team, in the order of the worlds.
        observation: the columns.
        actions: the actions; none where they are continuous.
        action_kind: "continuous" where a policy gives a force itself; see `about`.
        stations: places [m] that charge batteries.
        depots: places [m] that refill loads.
        network: what numpy needs.
        actors: the ONNX file of each actor.
        weights_sha256: that of the tensors of `weights.safetensors`: names, types, shapes, bytes.
        files: all other files of the folder.
        checked: what the check found.
    """

    __pydantic_config__ = _STRICT

    format: Literal["innerattn.export"]
    version: Literal[1]
    about: dict[str, str]
    made_with: dict[str, str]
    run: dict[str, str | int | None]
    scenario: dict[str, Any]
    scenario_sha256: _Sha256
    control_period_s: _Positive
    damping: _Share
    arena_half_width_m: _Positive
    victim_order: Literal["relevant", "slot"]
    victim_slots: _Index
    observe_faults: bool
    max_age_s: _Positive
    greedy_actions: bool
    abilities: tuple[str, ...]
    tasks: tuple[NeededAbilities, ...]
    robots: Annotated[tuple[Member, ...], Field(min_length=1, max_length=64)]
    observation: Annotated[tuple[Column, ...], Field(min_length=1)]
    actions: tuple[Action, ...]
    network: Network
    actors: dict[_Name, _File]
    weights_sha256: _Sha256
    files: dict[_File, FileEntry]
    checked: Checked | None
    action_kind: Literal["discrete", "continuous"] = "discrete"
    stations: tuple[tuple[_Number, _Number], ...] = ()
    depots: tuple[tuple[_Number, _Number], ...] = ()

    @property
    def outputs(self) -> int:
        """O, numbers that a policy gives: a logit for each action, or two means and log stds."""
        return CONTINUOUS_OUTPUTS if self.action_kind == "continuous" else len(self.actions)


_CHECK = TypeAdapter(Contract)


def digest_of(document: Any) -> str:
    """SHA-256, in hexadecimal, of a document as JSON with sorted keys and without spaces."""
    text = json.dumps(document, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()


def contract_text(document: dict[str, Any]) -> bytes:
    """The bytes of a contract.

    Args:
        document: the values of `Contract` as JSON.

    Raises:
        ValueError: the document is no contract.
    """
    _checked(document)
    sealed = {**document, "sha256": digest_of(document)}
    return (json.dumps(sealed, indent=1, allow_nan=False) + "\n").encode()


def contract_in(data: bytes) -> Contract:
    """What the bytes of a contract say.

    Raises:
        ValueError: they are damaged, altered, of another version, or say what cannot be.
    """
    document = parse_json(data)
    if not isinstance(document, dict) or document.get("format") != FORMAT:
        raise ValueError("not the contract of an exported team")
    if document.get("version") != VERSION:
        raise ValueError(f"version {document.get('version')!r}, only {VERSION} is known")
    if document.pop("sha256", None) != digest_of(document):
        raise ValueError("does not fit its own digest; it was altered")
    return _checked(document)


def _checked(document: dict[str, Any]) -> Contract:
    try:
        contract = _CHECK.validate_json(json.dumps(document))
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(map(str, first["loc"]))
        raise ValueError(f"{place}: {first['msg']}") from error
    for robot in contract.robots:
        _check_member(robot, len(contract.actions))
    discrete = contract.action_kind == "discrete"
    if bool(contract.actions) != discrete or (contract.network.log_std is None) != discrete:
        raise ValueError(
            "action_kind: 'discrete' needs actions, 'continuous' network.log_std; never both"
        )
    if digest_of(contract.scenario) != contract.scenario_sha256:
        raise ValueError("scenario_sha256: is not that of the scenario beside it")
    if missing := {WEIGHTS, *contract.actors.values()} - contract.files.keys():
        raise ValueError(f"files: {min(missing)} is missing")
    if unknown := {robot.actor for robot in contract.robots} - contract.actors.keys():
        raise ValueError(f"actors: {min(unknown)} is missing")
    return contract


def _check_member(robot: Member, actions: int) -> None:
    """Refuse a robot whose numbers do not fit its drive or its sensor."""
    needed = {
        "unicycle": (robot.max_turn_rad_s, robot.acceleration_m_s2, robot.turn_acceleration_rad_s2),
        "differential": (robot.max_turn_rad_s, robot.acceleration_m_s2, robot.track_m),
    }
    if None in needed.get(robot.drive, ()):
        raise ValueError(f"robots: {robot.name} lacks a limit of its drive {robot.drive!r}")
    own = actions if robot.has_wheels else 0
    if len(robot.actions) != own:
        raise ValueError(f"robots: {robot.name} must have {own} actions of its own")
    sensor = robot.range_sensor
    if sensor is not None and len(sensor.angles_rad) != sensor.rays:
        raise ValueError(f"robots: {robot.name} must have an angle for each ray")
