"""The description of one rescue world: team, tasks, arena, reward.

Names, types, defaults and units live here; ranges and rules between fields live in the compiled
module, which checks every scenario once, when it is made. What that check returns is what worlds
are made of.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import Field, PrivateAttr, ValidationError, field_validator

from innerattn import _core
from innerattn.config.amounts import Amounts, list_or_table
from innerattn.config.battery import Battery, Depot, Station
from innerattn.config.communication import Communication
from innerattn.config.files import preset_names, preset_table, toml_table
from innerattn.config.map import Map
from innerattn.config.map_file import with_map_file
from innerattn.config.model import ADDED_LATER, Model, Told, config_error
from innerattn.config.near import did_you_mean
from innerattn.config.range_sensor import RangeSensor
from innerattn.config.task import Arrival, Task
from innerattn.errors import ConfigError
from innerattn.shown import Shown

SCENARIOS = preset_names("scenarios")
"""Names of the built-in scenarios."""

Count = Annotated[int, Field(ge=0, lt=2**32)]
"""What the compiled module can hold as a count; how many are allowed is decided there."""


class Robot(Model):
    """One robot of the team."""

    name: str = Field(description="unique name; 1 to 64 letters, digits, '_' or '-'")
    kind: str = Field(description="kind, shared by robots that are alike")
    abilities: tuple[str, ...] | Amounts = Field(
        description="what it can do for a victim: a list, or a table with an amount of each, such "
        "as { water = 1.2 }; in a list each has the amount 1"
    )
    max_speed_mps: Annotated[float, Told(0.01, 100.0)] = Field(description="speed limit [m/s]")
    mass_kg: Annotated[float, Told(0.01, 1_000.0)] = Field(description="mass [kg]")
    radius_m: Annotated[float, Told(0.005, 10.0)] = Field(
        0.05, description="radius of the disc [m]"
    )
    drive_force_n: Annotated[float, Told(0.0, 1e5)] = Field(
        5.0, description="force of a full command, where actions set a force [N]"
    )
    drive: Annotated[Literal["force", "velocity", "unicycle", "differential"], ADDED_LATER] = Field(
        "force",
        description="what actions set; force: it takes time until the robot is fast and until it "
        "stands; velocity: a share of max_speed_mps, at once; unicycle: the speed along its "
        "heading and the turn rate; differential: the speeds of its two wheels",
    )
    max_turn_rad_s: Annotated[float, ADDED_LATER, Told(0.01, 1e4)] = Field(
        4.0,
        description="highest turn rate of a robot on wheels, at most half a circle in a control "
        "period [rad/s]",
    )
    acceleration_m_s2: Annotated[float, ADDED_LATER, Told(0.01, 1e5)] = Field(
        5.0, description="acceleration of a unicycle, and of each wheel of a differential [m/s^2]"
    )
    turn_acceleration_rad_s2: Annotated[float, ADDED_LATER, Told(0.01, 1e6)] = Field(
        20.0, description="acceleration of the turn rate of a unicycle [rad/s^2]"
    )
    wheel_base_m: Annotated[float | None, ADDED_LATER, Told(0.005, 20.0)] = Field(
        None,
        description="distance of the two wheels of a differential, at most 2 radius_m [m]; "
        "None: 2 radius_m",
    )
    layer: Annotated[str, ADDED_LATER] = Field(
        "ground",
        description="robots of different layers do not touch each other; 1 to 64 letters, digits, "
        "'_' or '-'",
    )
    start_m: Annotated[tuple[float, float] | None, ADDED_LATER] = Field(
        None,
        description="place when an episode starts, inside the walls [m]; "
        "None: a new random place each episode",
    )
    battery: Annotated[Battery | None, ADDED_LATER] = Field(
        None,
        description="its battery, such as { capacity_j = 100.0, per_m_j = 20.0, idle_w = 1.0 }; "
        "None: it needs no energy",
    )
    load: Annotated[Count | None, ADDED_LATER, Told(1, 1_000)] = Field(
        None,
        description="how many rescues it can help with before a depot refills it; None: any number",
    )
    sight_m: Annotated[float | None, ADDED_LATER, Told(0.005, 1_000.0)] = Field(
        None,
        description="how far it sees teammates and victims, from its centre to theirs, above "
        "radius_m [m]; None: it sees all",
    )
    field_of_view_deg: Annotated[float, ADDED_LATER, Told(1.0, 360.0)] = Field(
        360.0,
        description="angle within which it sees, its middle straight ahead; below 360 only of "
        "robots with a heading [degrees]",
    )
    range_sensor: Annotated[RangeSensor | None, ADDED_LATER] = Field(
        None,
        description="measures how far walls, obstacles and robots are, such as "
        "{ rays = 16, range_m = 1.0 }; None: it has none",
    )

    _check_abilities = field_validator("abilities", mode="before")(list_or_table)

    def amount(self, ability: str) -> float:
        """How much it gives of an ability, 0 without it."""
        if isinstance(self.abilities, dict):
            return self.abilities.get(ability, 0.0)
        return float(ability in self.abilities)

    def gain_mps(self, dt_s: float) -> float:
        """Speed that a full command adds in a control period of ``dt_s``, up to its limit [m/s]."""
        if self.drive == "velocity":
            return self.max_speed_mps
        if self.has_wheels:
            return self.acceleration_m_s2 * dt_s
        return self.drive_force_n / self.mass_kg * dt_s

    def kept(self, damping: float) -> float:
        """Share of its velocity that a control period begins with."""
        if self.has_wheels:
            return 1.0
        return 0.0 if self.drive == "velocity" else 1.0 - damping

    @property
    def has_wheels(self) -> bool:
        """Whether it drives along a heading."""
        return self.drive in ("unicycle", "differential")

    @property
    def has_limited_sight(self) -> bool:
        """Whether it sees less than everything that nothing hides."""
        return self.sight_m is not None or self.field_of_view_deg < 360.0

    @property
    def track_m(self) -> float:
        """Distance of its two wheels [m]."""
        return 2.0 * self.radius_m if self.wheel_base_m is None else self.wheel_base_m


class Obstacle(Model):
    """A fixed body in the way."""

    shape: Literal["disc", "box"] = Field(description="outline")
    radius_m: float | None = Field(
        None, description="radius of a disc, 0.005 to arena_half_width_m [m]"
    )
    half_extents_m: tuple[float, float] | None = Field(
        None,
        description="half width and half height of a box, each 0.005 to arena_half_width_m [m]",
    )
    position_m: tuple[float, float] | None = Field(
        None, description="centre, inside the walls [m]; None: a new random place each episode"
    )
    layers: Annotated[tuple[str, ...] | None, ADDED_LATER, Told(1, 64)] = Field(
        None, description="layers of the robots that touch it; None: all"
    )

    def blocks(self, layer: str) -> bool:
        """Whether robots of a layer touch it."""
        return self.layers is None or layer in self.layers


class Fault(Model):
    """Something that goes wrong with a robot."""

    robot: str = Field(description="name of the robot")
    kind: Literal[
        "motor_gain",
        "speed_limit",
        "heading_bias",
        "position_noise",
        "velocity_noise",
        "frozen_sensor",
        "blackout",
        "unavailable",
        "lost_communication",
    ] = Field(description="what goes wrong")
    value: float = Field(
        description="how badly; "
        + "; ".join(
            f"{name}: {meaning}, {low:.4g} to {high:.4g}" + f" [{unit}]" * bool(unit)
            for name, unit, low, high, _, meaning in _core.FAULT_KINDS
        )
    )
    onset_step: Count = Field(
        0, description="control step at which it begins, or from which on it may begin at random"
    )
    onset_rate_hz: Annotated[float | None, Told(1e-6, 1_000.0)] = Field(
        None, description="how often it begins at random while it is not there [1/s]; None: once"
    )
    duration_steps: Annotated[Count | None, Told(1, 1_000_000)] = Field(
        None, description="control steps it lasts; None: to the end of the episode"
    )


def scenario_table(path: str | Path) -> dict[str, Any]:
    """The keys of a scenario in a TOML file: those of its section ``scenario``, or of all of it.

    The file of a map is read: its rows stand in its place.

    Raises:
        ConfigError: the file cannot be read, is not TOML, or has both forms, or its map is none.
    """
    table = toml_table(path)
    section = table.get(Scenario.place)
    if not isinstance(section, dict):
        return with_map_file(table, path)
    if both := [key for key in table if key in Scenario.model_fields]:
        raise ConfigError(f"{path}: {both[0]}: must stand in [scenario], as the others do")
    return with_map_file(section, path)


def _default_team() -> tuple[Robot, ...]:
    """The four robots of Table I."""
    slow: dict[str, Any] = {"kind": "food", "abilities": ("food",), "max_speed_mps": 1.0}
    fast: dict[str, Any] = {"max_speed_mps": 1.5, "mass_kg": 0.5}
    return (
        Robot(name="food_0", mass_kg=1.0, **slow),
        Robot(name="food_1", mass_kg=1.0, **slow),
        Robot(name="navigation_0", kind="navigation", abilities=("information",), **fast),
        Robot(name="medical_0", kind="medical", abilities=("medicine",), **fast),
    )


def _default_tasks() -> tuple[Task, ...]:
    return (
        Task(name="task_1", needs=("food", "medicine")),
        Task(name="task_2", needs=("food", "information")),
    )


def _need_of_nobody(robots: tuple[Robot, ...], tasks: tuple[Task, ...]) -> str:
    """What to say of the first need that no robot can serve; empty where there is none."""
    abilities = list(dict.fromkeys(one for robot in robots for one in robot.abilities))
    given = ", ".join(abilities) or "none"
    for index, task in enumerate(tasks):
        for need in task.needs:
            if need not in abilities:
                return (
                    f"scenario.tasks[{index}].needs: task {task.name!r} needs {need!r}, which no "
                    f"robot of the team can do; abilities of the team are {given}"
                    f"{did_you_mean(need, abilities, repr)}"
                )
    return ""


class Scenario(Model, Shown):
    """Everything that defines a rescue world.

    Raises:
        pydantic.ValidationError: (a `ValueError`) unknown key, wrong type, value out of range, or
            values that contradict each other; the message names the key and the allowed range.
    """

    place: ClassVar[str] = "scenario"

    situation: Literal["single", "double", "mixed", "poisson", "listed"] = Field(
        "mixed",
        description="single: one victim at a time; double: one of each task, always; "
        "mixed: waves of 1 to max_victims victims of random tasks; poisson: victims of each task "
        "arrive at random, at the task's arrival_rate_hz; listed: victims arrive as arrivals says",
    )
    robots: Annotated[tuple[Robot, ...], Told(1, 64)] = Field(
        default_factory=_default_team, description="the team"
    )
    tasks: Annotated[tuple[Task, ...], Told(1, 32)] = Field(
        default_factory=_default_tasks, description="kinds of victim"
    )
    max_victims: Annotated[Count, Told(1, 32)] = Field(
        2, description="most victims of a wave in mixed, and of each task at once where they arrive"
    )
    arrivals: Annotated[tuple[Arrival, ...], ADDED_LATER, Told(0, 1_000)] = Field(
        (), description="which victims arrive in listed, and when"
    )
    obstacles: Annotated[tuple[Obstacle, ...], Told(0, 64)] = Field(
        (), description="fixed bodies in the way"
    )
    map: Annotated[Map | None, ADDED_LATER] = Field(
        None,
        description="which cells of a grid over the arena are solid, such as "
        '{ file = "office.yaml" }; None: none',
    )
    occlusion: Annotated[bool, ADDED_LATER] = Field(
        False,
        description="let obstacles and solid cells hide what is behind them, from robots of the "
        "layers that they block; true only where there are such",
    )
    communication: Annotated[Communication | None, ADDED_LATER] = Field(
        None,
        description="who hears whom, when, and what robots tell each other, such as "
        "{ range_m = 0.8, delay_steps = 2 }; None: all hear all others at once",
    )
    stations: Annotated[tuple[Station, ...], ADDED_LATER, Told(0, 64)] = Field(
        (), description="places that charge batteries"
    )
    depots: Annotated[tuple[Depot, ...], ADDED_LATER, Told(0, 64)] = Field(
        (), description="places that refill loads"
    )
    arena_half_width_m: Annotated[float, Told(0.2, 100.0)] = Field(
        1.0, description="half the side of the square arena [m]"
    )
    rescue_radius_m: Annotated[float, Told(0.001, 10.0)] = Field(
        0.15, description="how near a helper must be [m]"
    )
    spawn_clearance_m: Annotated[float, Told(0.0, 10.0)] = Field(
        0.2, description="least distance of a new victim to robots [m]"
    )
    wall_clearance_m: Annotated[float, Told(0.0, 10.0)] = Field(
        0.1, description="least distance of a new victim to walls [m]"
    )
    victim_area_m: Annotated[tuple[float, float, float, float] | None, ADDED_LATER] = Field(
        None,
        description="rectangle in which victims appear: least x, least y, most x, most y [m]; "
        "None: the arena",
    )
    victim_places_m: Annotated[tuple[tuple[float, float], ...], ADDED_LATER, Told(0, 256)] = Field(
        (), description="the only places at which victims appear [m]; none given: any"
    )
    episode_steps: Annotated[Count, Told(1, 1_000_000)] = Field(
        25, description="length of an episode [control steps]"
    )
    end_when_rescued: Annotated[Count | None, Told(1, 1_000_000)] = Field(
        None, description="end an episode after so many rescues; None: never"
    )
    end_when_done: Annotated[bool, ADDED_LATER] = Field(
        False,
        description="end an episode when all victims of arrivals were rescued, lost or turned away",
    )
    dt_s: Annotated[float, Told(0.001, 1.0)] = Field(0.1, description="control period [s]")
    substeps: Annotated[Count, Told(1, 1_000)] = Field(
        6, description="physics steps per control period"
    )
    damping: Annotated[float, Told(0.0, 1.0)] = Field(
        0.25, description="share of speed lost per control period"
    )
    friction: Annotated[float, Told(0.0, 10.0)] = Field(
        0.0, description="friction coefficient at contacts"
    )
    engine: Literal["rapier", "discs", "none"] = Field(
        "rapier",
        description="contacts; rapier: rigid bodies in substeps; discs: exact, without friction; "
        "none: robots pass through each other",
    )
    actions: Literal["discrete", "continuous"] = Field(
        "discrete",
        description="discrete: stay, +x, -x, +y, -y, on wheels stop, forward, backward, turn left, "
        "turn right; continuous: a force or a velocity in the plane, speed and turn rate, or the "
        "speeds of the left and right wheel, as the robot's drive says",
    )
    rescue_credit: Literal["helpers", "team"] = Field(
        "helpers", description="who is rewarded for a rescue"
    )
    rescue_reward: Annotated[float, Told(-1e6, 1e6)] = Field(
        1.0, description="reward of one rescue"
    )
    shaping: Literal["progress", "potential", "none"] = Field(
        "progress", description="reward for coming nearer to victims"
    )
    shaping_weight: Annotated[float, Told(-1e6, 1e6)] = Field(
        1.0, description="weight of the shaping reward [1/m]"
    )
    shaping_discount: Annotated[float, Told(0.0, 1.0)] = Field(
        0.95, description="discount used by potential shaping"
    )
    contact_cost: Annotated[float, Told(-1e6, 1e6)] = Field(
        0.0, description="cost of a control step with a contact"
    )
    action_cost: Annotated[float, Told(-1e6, 1e6)] = Field(
        0.0, description="cost of a control step with the drive on"
    )
    lost_cost: Annotated[float, ADDED_LATER, Told(-1e6, 1e6)] = Field(
        0.0, description="cost of a lost victim, for every robot"
    )
    victim_order: Literal["relevant", "slot"] = Field(
        "relevant",
        description="order of victims in an observation; relevant: helpable first, then nearest",
    )
    observed_teammates: Annotated[Count | None, ADDED_LATER, Told(0, 63)] = Field(
        None,
        description="teammates in an observation, the nearest first; None: all, in team order",
    )
    observed_victims: Annotated[Count | None, ADDED_LATER, Told(1, 32)] = Field(
        None, description="victims in an observation, the first in victim_order; None: all"
    )
    faults: Annotated[tuple[Fault, ...], Told(0, 256)] = Field(
        (), description="what goes wrong with which robot, and when"
    )
    observe_faults: bool = Field(
        False, description="let robots see the faults in effect, their own and their teammates'"
    )
    unavailable_robots: Annotated[Literal["stay", "leave"], ADDED_LATER] = Field(
        "stay",
        description="unavailable robots; stay: they stand in the arena; leave: they are not in it",
    )

    _rules: _core.Rules = PrivateAttr()

    def model_post_init(self, _context: object, /) -> None:
        """Check the scenario and keep what the check returned."""
        try:
            self._rules = _core.Rules(self.model_dump_json())
        except ValueError as error:
            missing = _need_of_nobody(self.robots, self.tasks)
            if missing and ".needs" in str(error):
                raise ValueError(missing) from error
            raise

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """A copy; one with changed fields is checked, as `replace` does.

        Raises:
            ConfigError: unknown field or invalid value.
        """
        return self.replace(**update) if update else super().model_copy(deep=deep)

    @property
    def rules(self) -> _core.Rules:
        """This scenario as the compiled module found it valid: what a batch of worlds takes."""
        return self._rules

    @classmethod
    def preset(cls, name: str) -> Scenario:
        """The built-in scenario ``name``.

        Raises:
            ConfigError: no such preset; the message names the known ones.
        """
        return cls.model_validate(preset_table("scenarios", name))

    @classmethod
    def from_toml(cls, path: str | Path, **fields: object) -> Scenario:
        """The scenario in a TOML file: its keys, at the top or in a section ``scenario``.

        So the configuration of a run is such a file, too.

        Args:
            path: the file.
            **fields: values that win over the file's.

        Raises:
            ConfigError: the file cannot be read, is not TOML, or describes no valid scenario.
        """
        try:
            return cls.model_validate(scenario_table(path) | fields)
        except ValidationError as error:
            raise config_error(error, "scenario", str(path), cls) from error

    @property
    def num_robots(self) -> int:
        """Number of robots R."""
        return len(self.robots)

    @property
    def num_victims(self) -> int:
        """Number of victim slots V."""
        return self._rules.num_victims

    def slots_of(self, task: int) -> range:
        """The slots that victims of a task may have."""
        if self.situation in ("single", "mixed"):
            return range(self.num_victims)
        each = self.max_victims if self.has_arrivals else 1
        return range(self.num_victims)[task * each : (task + 1) * each]

    @property
    def max_helpers(self) -> int:
        """Most robots that can help one victim."""
        return self._rules.max_helpers

    @property
    def has_services(self) -> bool:
        """Whether the rescue of some victims takes time."""
        return any(task.service_s > 0.0 for task in self.tasks)

    @property
    def longest_deadline_s(self) -> float:
        """The longest deadline of all tasks [s]; 0 where none has one."""
        return max((task.deadlines_s[1] for task in self.tasks if task.deadlines_s), default=0.0)

    @property
    def has_deadlines(self) -> bool:
        """Whether some victims can be lost."""
        return any(task.deadline_s is not None for task in self.tasks)

    @property
    def has_order(self) -> bool:
        """Whether some victims have to wait for others."""
        return any(task.after for task in self.tasks)

    @property
    def asks_for_plans(self) -> bool:
        """Whether who goes where next depends on what comes after."""
        timed = self.has_services or self.has_deadlines or self.has_order or self.has_arrivals
        return (
            timed or self.has_batteries or self.has_loads or any(task.sums for task in self.tasks)
        )

    @property
    def has_batteries(self) -> bool:
        """Whether some robots have a battery."""
        return any(robot.battery is not None for robot in self.robots)

    @property
    def has_loads(self) -> bool:
        """Whether some robots can help with so many rescues alone before a depot refills them."""
        return any(robot.load is not None for robot in self.robots)

    @property
    def has_limited_sight(self) -> bool:
        """Whether there is something in an arena that some robot does not see."""
        return self.occlusion or any(robot.has_limited_sight for robot in self.robots)

    @property
    def max_rays(self) -> int:
        """Most rays of a robot's range sensor, 0 where no robot has one."""
        return max(one.range_sensor.rays if one.range_sensor else 0 for one in self.robots)

    @property
    def limits_communication(self) -> bool:
        """Whether some robots do not hear others, or not at once."""
        return self.communication is not None and self.communication.limits

    @property
    def message_delay_steps(self) -> int:
        """Control steps from sending to hearing."""
        return self.communication.delay_steps if self.communication else 0

    @property
    def has_wheels(self) -> bool:
        """Whether some robot has a heading."""
        return any(robot.has_wheels for robot in self.robots)

    @property
    def layers(self) -> tuple[str, ...]:
        """The layers of the robots: "ground", then the others by the first robot of each."""
        found = dict.fromkeys(robot.layer for robot in self.robots)
        return tuple(sorted(found, key=lambda layer: layer != "ground"))

    @property
    def robots_leave(self) -> bool:
        """Whether unavailable robots are not in the arena."""
        return self.unavailable_robots == "leave"

    @property
    def has_action_masks(self) -> bool:
        """Whether views tell which discrete actions have an effect.

        They do where robots may be unavailable or without charge, and cannot act then.
        """
        faulty = any(fault.kind == "unavailable" for fault in self.faults)
        unable = faulty or self.robots_leave or self.has_batteries
        return unable and self.actions == "discrete"

    @property
    def has_arrivals(self) -> bool:
        """Whether victims arrive whatever becomes of others, so that some may find no slot."""
        return self.situation in ("poisson", "listed")

    @cached_property
    def map_boxes(self) -> tuple[Obstacle, ...]:
        """The solid cells of the map, as few boxes with a place; none without a map."""
        if self.map is None:
            return ()
        return tuple(
            Obstacle(
                shape="box",
                position_m=(x, y),
                half_extents_m=(width, height),
                layers=self.map.layers,
            )
            for x, y, width, height in self._rules.map_boxes()
        )

    @property
    def blocks_ways(self) -> bool:
        """Whether something stands in the way of some robots."""
        return bool(self.obstacles) or self.map is not None

    @property
    def ends_early(self) -> bool:
        """Whether an episode may end before its time is up, as its goal is reached."""
        return self.end_when_rescued is not None or self.end_when_done

    @property
    def only_places_m(self) -> tuple[tuple[float, float], ...]:
        """The only places at which victims appear [m]; none: any."""
        if self.arrivals:
            return tuple(one.position_m for one in self.arrivals)
        holds = [task.holds for task in self.tasks]
        return tuple(at for at in self.victim_places_m if any(one(*at) for one in holds))

    def area_of(self, task: Task) -> tuple[float, float, float, float]:
        """Where victims of a task appear: least x, least y, most x, most y [m]."""
        reach = self.arena_half_width_m - self.wall_clearance_m
        return task.area_m or self.victim_area_m or (-reach, -reach, reach, reach)
