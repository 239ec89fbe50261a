"""What the file ``contract.json`` of an exported team says, as checked plain data."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

from innerattn.config.untrusted import parse_json
from innerattn.policies.exported.plain_data import (
    anything,
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

FORMAT = "innerattn.export"
VERSION = 1
NAME = "contract.json"
WEIGHTS = "weights.safetensors"
CONTINUOUS_OUTPUTS = 4
"""Of a policy over forces: mean x and y, then log standard deviation x and y, before tanh."""

MOST_NEEDS = 8
"""Abilities that a task may need; a policy for any team looks at all sets of them."""


@dataclass(frozen=True)
class Column:
    """One number of an observation: its name, unit, frame, and what a robot takes it from."""

    name: str
    unit: str
    frame: str
    source: str


@dataclass(frozen=True)
class Action:
    """One action: its number, and the force [share of full force, x and y of the world]."""

    number: int
    name: str
    force: tuple[float, float]


@dataclass(frozen=True)
class RangeRays:
    """A range sensor: rays from the robot's centre, and how far each reaches.

    The angles count from the robot's heading, or from the x axis for a robot without one,
    counterclockwise.
    """

    rays: int
    range_m: float
    angles_rad: tuple[float, ...]


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

    name: str
    kind: str
    abilities: tuple[str, ...] | dict[str, float]
    max_speed_mps: float
    mass_kg: float
    radius_m: float
    drive_force_n: float
    actor: str
    drive: Literal["force", "velocity", "unicycle", "differential"] = "force"
    actions: tuple[Action, ...] = ()
    max_turn_rad_s: float | None = None
    acceleration_m_s2: float | None = None
    turn_acceleration_rad_s2: float | None = None
    track_m: float | None = None
    sight_m: float | None = None
    field_of_view_deg: float | None = None
    range_sensor: RangeRays | None = None
    battery_j: float | None = None
    load: int | None = None

    @cached_property
    def has_wheels(self) -> bool:
        """Whether it drives along a heading."""
        return self.drive in ("unicycle", "differential")

    @cached_property
    def stores(self) -> tuple[str, ...]:
        """What it has of ``charge`` and ``load``."""
        found = {"charge": self.battery_j, "load": self.load}
        return tuple(key for key, most in found.items() if most is not None)


@dataclass(frozen=True)
class NeededAbilities:
    """One kind of victim: the abilities that it needs, from a robot of its own each, or as sums."""

    name: str
    needs: tuple[str, ...] | dict[str, float]

    def amount(self, ability: str) -> float:
        """How much of an ability is needed; of a list, how many robots."""
        if isinstance(self.needs, dict):
            return self.needs.get(ability, 0.0)
        return float(self.needs.count(ability))


@dataclass(frozen=True)
class Entities:
    """Whose columns are whose: those of the robot, of each teammate, of each victim.

    ``present`` of a victim's columns says that it is there, ``seen`` of a teammate's, if it has
    such a column. Places are columns x and y, for the pooling "nearest".
    """

    own: int
    teammates: int
    teammate: int
    victims: int
    victim: int
    present: int
    seen: int | None = None
    teammate_place: tuple[int, int] | None = None
    victim_place: tuple[int, int] | None = None


@dataclass(frozen=True)
class FrameColumns:
    """Columns that turn: pairs (x, y), those that change sign in a mirror, those that choose.

    Those of rays change places: ``ray_turns`` says for each element of the group which of them
    takes the place of each.
    """

    vectors: tuple[tuple[int, int], ...]
    handed: tuple[int, ...]
    anchors: tuple[tuple[int, int], ...]
    rays: tuple[int, ...] = ()
    ray_turns: tuple[tuple[int, ...], ...] = ()


@dataclass(frozen=True)
class LogStd:
    """Log standard deviations of outputs z: lowest + (highest - lowest) sigmoid(z + shift)."""

    lowest: float
    highest: float
    shift: float


@dataclass(frozen=True)
class PairRules:
    """What a policy for any team must know besides robots, tasks and the arena.

    Attributes:
        rescue_radius_m: how near a robot must be to help.
        robots_leave: whether robots that are not available are not in the arena.
        key_width: width of queries and keys, where the pooling is attention.
        services_s: how long helpers stay at a victim of each task [s]; none where all are rescued
            at touch.
        longest_deadline_s: what shares of time left are shares of [s]; 0 without deadlines.
    """

    rescue_radius_m: float
    robots_leave: bool
    key_width: int
    services_s: tuple[float, ...] = ()
    longest_deadline_s: float = 0.0


@dataclass(frozen=True)
class Network:
    """How the numbers of `weights.safetensors` make a policy; `log_std` of continuous actions.

    ``pooling`` says what the encoder "entities" makes of several entities, and "pairs" of several
    robots at a victim. The encoder "pairs" is that of policies for any team.
    """

    encoder: Literal["flat", "entities", "pairs"]
    hidden_width: int
    leaky_relu_slope: float
    entities: Entities | None
    frame: FrameColumns | None
    log_std: LogStd | None = None
    pooling: Literal["attention", "mean", "max", "nearest"] = "attention"
    pairs: PairRules | None = None


@dataclass(frozen=True)
class Checked:
    """What the check at the export found; there is no difference of what has no ONNX file."""

    observations: int
    same_greedy_action: int
    near_ties: int
    largest_difference_onnx: float | None
    largest_difference_numpy: float


@dataclass(frozen=True)
class FileEntry:
    """A file of the folder: its SHA-256 and size."""

    sha256: str
    bytes: int


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
        actors: the ONNX file of each actor; of a policy for any team `WEIGHTS`, as it has none.
        weights_sha256: that of the tensors of `weights.safetensors`: names, types, shapes, bytes.
        files: all other files of the folder.
        checked: what the check found.
    """

    format: Literal["innerattn.export"]
    version: Literal[1]
    about: dict[str, str]
    made_with: dict[str, str]
    run: dict[str, str | int | None]
    scenario: dict[str, Any]
    scenario_sha256: str
    control_period_s: float
    damping: float
    arena_half_width_m: float
    victim_order: Literal["relevant", "slot"]
    victim_slots: int
    observe_faults: bool
    max_age_s: float
    greedy_actions: bool
    abilities: tuple[str, ...]
    tasks: tuple[NeededAbilities, ...]
    robots: tuple[Member, ...]
    observation: tuple[Column, ...]
    actions: tuple[Action, ...]
    network: Network
    actors: dict[str, str]
    weights_sha256: str
    files: dict[str, FileEntry]
    checked: Checked | None
    action_kind: Literal["discrete", "continuous"] = "discrete"
    stations: tuple[tuple[float, float], ...] = ()
    depots: tuple[tuple[float, float], ...] = ()

    @property
    def outputs(self) -> int:
        """O, numbers that a policy gives: a logit for each action, or two means and log stds."""
        return CONTINUOUS_OUTPUTS if self.action_kind == "continuous" else len(self.actions)


_TEXT = text()
_NAME = text("[A-Za-z0-9_-]{1,200}", "1 to 200 letters, digits, - or _")
_FILE = text(r"[A-Za-z0-9_-]{1,200}\.(onnx|safetensors)", "NAME.onnx or NAME.safetensors")
_SHA256 = text("[0-9a-f]{64}", "64 hexadecimal digits")
_NUMBER = number()
_POSITIVE = number(above=0)
_INDEX = whole(0, 2**20)
_INDICES = many(_INDEX)
_PLACES = many(pair(_NUMBER))
_AMOUNTS = list_or_table(many(_TEXT), table(_POSITIVE))


def _origin(value: Any, place: str) -> str | int | None:
    """A text, a whole number or none."""
    if value is None or (isinstance(value, int) and not isinstance(value, bool)):
        return value
    found: str = _TEXT(value, place)
    return found


_COLUMN = record(Column, name=_TEXT, unit=_TEXT, frame=_TEXT, source=_TEXT)
_ACTION = record(Action, number=_INDEX, name=_TEXT, force=pair(_NUMBER))
_RAYS = record(RangeRays, rays=whole(1, 361), range_m=_POSITIVE, angles_rad=many(_NUMBER))
_MEMBER = record(
    Member,
    name=_NAME,
    kind=_NAME,
    abilities=_AMOUNTS,
    max_speed_mps=_POSITIVE,
    mass_kg=_POSITIVE,
    radius_m=_POSITIVE,
    drive_force_n=number(least=0),
    actor=_NAME,
    drive=one_of("force", "velocity", "unicycle", "differential"),
    actions=many(_ACTION),
    max_turn_rad_s=optional(_POSITIVE),
    acceleration_m_s2=optional(_POSITIVE),
    turn_acceleration_rad_s2=optional(_POSITIVE),
    track_m=optional(_POSITIVE),
    sight_m=optional(_POSITIVE),
    field_of_view_deg=optional(_POSITIVE),
    range_sensor=optional(_RAYS),
    battery_j=optional(_POSITIVE),
    load=optional(whole(1)),
)
_ENTITIES = record(
    Entities,
    own=_INDEX,
    teammates=_INDEX,
    teammate=_INDEX,
    victims=_INDEX,
    victim=_INDEX,
    present=_INDEX,
    seen=optional(_INDEX),
    teammate_place=optional(pair(_INDEX)),
    victim_place=optional(pair(_INDEX)),
)
_FRAME = record(
    FrameColumns,
    vectors=many(pair(_INDEX)),
    handed=_INDICES,
    anchors=many(pair(_INDEX), 1),
    rays=_INDICES,
    ray_turns=many(_INDICES),
)
_NETWORK = record(
    Network,
    encoder=one_of("flat", "entities", "pairs"),
    hidden_width=whole(1, 4097),
    leaky_relu_slope=number(least=0, below=1),
    entities=optional(_ENTITIES),
    frame=optional(_FRAME),
    log_std=optional(record(LogStd, lowest=_NUMBER, highest=_NUMBER, shift=_NUMBER)),
    pooling=one_of("attention", "mean", "max", "nearest"),
    pairs=optional(
        record(
            PairRules,
            rescue_radius_m=number(least=0),
            robots_leave=flag,
            key_width=whole(1, 4097),
            services_s=many(number(least=0)),
            longest_deadline_s=number(least=0),
        )
    ),
)
_CHECKED = record(
    Checked,
    observations=_INDEX,
    same_greedy_action=whole(0),
    near_ties=whole(0),
    largest_difference_onnx=optional(_NUMBER),
    largest_difference_numpy=_NUMBER,
)
_CONTRACT = record(
    Contract,
    format=one_of(FORMAT),
    version=one_of(VERSION),
    about=table(_TEXT),
    made_with=table(_TEXT),
    run=table(_origin),
    scenario=table(anything),
    scenario_sha256=_SHA256,
    control_period_s=_POSITIVE,
    damping=number(least=0, most=1),
    arena_half_width_m=_POSITIVE,
    victim_order=one_of("relevant", "slot"),
    victim_slots=_INDEX,
    observe_faults=flag,
    max_age_s=_POSITIVE,
    greedy_actions=flag,
    abilities=many(_TEXT),
    tasks=many(record(NeededAbilities, name=_TEXT, needs=_AMOUNTS)),
    robots=many(_MEMBER, 1, 64),
    observation=many(_COLUMN, 1),
    actions=many(_ACTION),
    network=_NETWORK,
    actors=table(_FILE, _NAME),
    weights_sha256=_SHA256,
    files=table(record(FileEntry, sha256=_SHA256, bytes=whole(0, 2**40)), _FILE),
    checked=optional(_CHECKED),
    action_kind=one_of("discrete", "continuous"),
    stations=_PLACES,
    depots=_PLACES,
)


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
    contract: Contract = _CONTRACT(document, "")
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
    _check_pairs(contract)
    return contract


def _check_pairs(contract: Contract) -> None:
    """Refuse a policy for any team with what it does not know, and other policies with its parts.

    What it refuses is what `innerattn.config.refusals` refuses of a scenario.
    """
    network = contract.network
    if (network.encoder == "pairs") != (network.pairs is not None):
        raise ValueError("network.pairs: must be there for the encoder 'pairs' alone")
    if network.pairs is None:
        return
    if network.entities is not None or network.frame is not None or not contract.actions:
        raise ValueError("network: the encoder 'pairs' needs actions, no entities and no frame")
    if len(network.pairs.services_s) not in (0, len(contract.tasks)):
        raise ValueError("network.pairs.services_s: must have an entry for each task, or none")
    if not contract.tasks:
        raise ValueError("tasks: has 0 entries: must have at least 1 for the encoder 'pairs'")
    for task in contract.tasks:
        if (needed := len(set(task.needs))) > MOST_NEEDS:
            raise ValueError(
                f"tasks: {task.name} needs {needed} abilities: must be at most {MOST_NEEDS} for "
                "policies for any team"
            )
    for key in ("observed_teammates", "observed_victims"):
        if contract.scenario.get(key) is not None:
            raise ValueError(f"scenario.{key}: must be None; policies for any team see everything")
    for robot in contract.robots:
        senses = (robot.sight_m, robot.field_of_view_deg, robot.range_sensor)
        if robot.drive != "force" or robot.stores or any(one is not None for one in senses):
            raise ValueError(
                f"robots: {robot.name} must set forces, see everything and have no stores; "
                "policies for any team know nothing else"
            )


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
