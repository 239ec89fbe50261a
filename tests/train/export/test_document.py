"""Contracts of all kinds of teams: rows built by them are those of the worlds, to the bit."""

import json
from collections.abc import Callable
from contextlib import closing
from dataclasses import asdict
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_export import readings_of

from innerattn.config import (
    SCENARIOS,
    Battery,
    Communication,
    Depot,
    Obstacle,
    RangeSensor,
    Robot,
    RunConfig,
    Scenario,
    Station,
    Task,
    TrainConfig,
)
from innerattn.envs import BatchEnv
from innerattn.errors import ReadingError
from innerattn.policies.exported.contract import WEIGHTS, Contract, contract_in, contract_text
from innerattn.policies.exported.decision import (
    twist_command,
    velocity_command,
    wheel_speeds,
)
from innerattn.policies.exported.readings import RowBuilder
from innerattn.train.export.document import contract_document, network_of


class Team:
    """What `readings_of` needs of a team."""

    def __init__(self, scenario: Scenario, names: list[str]) -> None:
        self.contract = contract_of(scenario, names)
        self.robot_names = tuple(robot.name for robot in self.contract.robots)


def contract_of(scenario: Scenario, names: list[str]) -> Contract:
    """The contract of a team in these worlds, of files that are not there."""
    config = RunConfig(scenario=scenario, train=TrainConfig(method="ppo-inner"))
    robots = [robot.name for robot in scenario.robots]
    files = {name: f"{name}.onnx" for name in robots}
    document = contract_document(
        config,
        names,
        network_of(config, names, None),
        of_robot=robots,
        actors=files,
        weights_sha256="0" * 64,
        run={"method": "td-inner"},
        files=dict.fromkeys((WEIGHTS, *files.values()), b""),
    )
    return contract_in(contract_text(document))


WITHOUT_ROWS = ("mixed-faults",)
"""Presets whose rows follow from more than readings: senses fail."""
ROUNDED = (".heading.x", ".heading.y", ".ahead", ".left")
"""Ends of names of columns that need a cosine, which differs in the last bit; rays are given as
distances."""


def check(scenario: Scenario, seed: int, worlds: int = 6) -> None:
    env = BatchEnv(scenario, worlds, seed=seed, num_threads=1)
    obs = env.reset()
    team = Team(scenario, env.observation_names())
    rng = np.random.default_rng(seed)
    robots = range(env.num_robots)
    builders = [RowBuilder(team.contract, robot, max_age_s=1.0) for robot in robots]
    names = env.observation_names()
    exact = np.array([not name.endswith(ROUNDED) and ".ray." not in name for name in names])
    for _ in range(3):
        for world in range(worlds):
            for robot, builder in enumerate(builders):
                name = team.robot_names[robot]
                readings = readings_of(team, name, env, world)  # type: ignore[arg-type]
                row = builder.row(readings)
                np.testing.assert_array_equal(row[exact], obs[world, robot, exact])
                np.testing.assert_allclose(row, obs[world, robot], rtol=0.0, atol=2e-6)
        for _ in range(4):
            obs = env.step(rng.integers(0, 5, (worlds, env.num_robots))).obs


@pytest.mark.parametrize("preset", [one for one in SCENARIOS if one not in WITHOUT_ROWS])
def test_rows_of_every_preset_are_those_of_the_worlds(preset: str) -> None:
    check(Scenario.preset(preset), seed=1)


def team_with_everything(rays: bool = True) -> tuple[Robot, ...]:
    """One robot of each drive; a battery, a load, short and narrow sight, and range sensors."""
    sensor = RangeSensor(rays=7, range_m=0.8, field_of_view_deg=200.0) if rays else None
    around = RangeSensor(rays=5, range_m=1.5) if rays else None
    food, other, navigation, medical = Scenario().robots
    return (
        food.replace(sight_m=0.7, battery=Battery(capacity_j=50.0, per_m_j=9.0, idle_w=3.0)),
        other.replace(drive="differential", field_of_view_deg=150.0, range_sensor=sensor, load=2),
        navigation.replace(drive="unicycle", sight_m=1.2, range_sensor=around),
        medical.replace(drive="velocity", layer="air"),
    )


def scenario_with_everything(**changes: object) -> Scenario:
    return Scenario(
        situation="double",
        robots=team_with_everything(),
        stations=(Station(position_m=(0.5, 0.5), recharge_w=20.0),),
        depots=(Depot(position_m=(-0.5, 0.2)), Depot(position_m=(0.6, -0.7))),
        obstacles=(Obstacle(shape="disc", radius_m=0.1),),
        occlusion=True,
        observe_faults=True,
        rescue_radius_m=0.4,
        episode_steps=9,
        **changes,  # type: ignore[arg-type]
    )


def everything() -> Contract:
    scenario = scenario_with_everything()
    with closing(BatchEnv(scenario, 1)) as env:
        return contract_of(scenario, env.observation_names())


def plain(contract: Contract) -> dict[str, Any]:
    """The values of a contract as JSON."""
    found: dict[str, Any] = json.loads(json.dumps(asdict(contract)))
    return found


@pytest.mark.parametrize("order", ["relevant", "slot"])
@pytest.mark.parametrize("radio", [None, Communication(range_m=0.9, delay_steps=1)])
def test_rows_of_every_drive_sense_and_store_are_those_of_the_worlds(
    order: str, radio: Communication | None
) -> None:
    check(scenario_with_everything(communication=radio, victim_order=order), seed=3, worlds=12)


def test_rows_of_robots_that_are_told_of_victims_are_those_of_the_worlds() -> None:
    radio = Communication(share="victims", delay_steps=2, loss=0.3)
    robots = tuple(robot.replace(sight_m=0.6) for robot in Scenario().robots)
    check(
        Scenario(
            situation="double",
            robots=robots,
            communication=radio,
            victim_order="slot",
            rescue_radius_m=0.3,
        ),
        seed=5,
        worlds=24,
    )


@pytest.mark.parametrize("radio", [None, Communication(range_m=0.9, delay_steps=1)])
@pytest.mark.parametrize("teammates", [0, 2, 9])
def test_rows_of_the_nearest_are_those_of_the_worlds(
    teammates: int, radio: Communication | None
) -> None:
    short = {"observed_teammates": teammates, "observed_victims": 1}
    check(scenario_with_everything(communication=radio, **short), seed=7)
    check(Scenario.preset("mixed-8").replace(communication=radio, **short), seed=8)


@pytest.mark.parametrize("actions", ["discrete", "continuous"])
def test_commands_are_what_the_worlds_do(actions: str) -> None:
    scenario = Scenario(
        robots=team_with_everything(rays=False),
        stations=(Station(position_m=(0.5, 0.5), recharge_w=20.0),),
        arena_half_width_m=50.0,
        actions=actions,  # type: ignore[arg-type]
        depots=(Depot(position_m=(0.0, 0.0)),),
    )
    with closing(BatchEnv(scenario, 8, seed=1, num_threads=1)) as env:
        env.reset()
        contract = contract_of(scenario, env.observation_names())
        apart = np.broadcast_to([(10.0 * robot, 0.0) for robot in range(4)], (8, 4, 2))
        env.set_motion(apart, np.zeros((8, 4, 2)))
        rng, twists = np.random.default_rng(0), np.zeros((8, 4, 2), np.float32)
        for _ in range(12):
            chosen = rng.integers(0, 5, (8, 4))
            shares = rng.uniform(-0.7, 0.7, (8, 4, 2)).astype(np.float32)
            places, moving, pointing = env.positions(), env.velocities(), env.headings()
            env.step(shares if actions == "continuous" else chosen)
            for world, index in np.ndindex(8, 4):
                robot, at = contract.robots[index], (world, index)
                table = robot.actions or contract.actions
                command = shares[at] if not table else np.array(table[chosen[at]].force, np.float32)
                if not robot.has_wheels:
                    found = velocity_command(contract, robot, command, moving[at])
                    np.testing.assert_allclose(found, env.velocities()[at], atol=1e-6)
                    continue
                twists[at] = speed, turn = twist_command(contract, robot, command, twists[at])
                assert env.turn_rates()[at] == pytest.approx(turn, abs=1e-5)
                middle, arc = pointing[at] + 0.05 * turn, 0.05 * turn
                chord = 0.1 * speed * np.sinc(arc / np.pi)
                moved = chord * np.array([np.cos(middle), np.sin(middle)])
                np.testing.assert_allclose(env.positions()[at] - places[at], moved, atol=1e-5)
        assert twists[:, 1:3].any(axis=0).all()
    differential = contract.robots[1]
    np.testing.assert_allclose(wheel_speeds(differential, np.float32([1.0, 2.0])), [0.9, 1.1])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda robot: robot.pop("track_m"), "robots: food_1 lacks a limit of its drive"),
        (lambda robot: robot["actions"].pop(), "robots: food_1 must have 5 actions of its own"),
        (lambda robot: robot["range_sensor"].update(rays=3), "food_1 must have an angle for each"),
    ],
)
def test_robots_that_cannot_be_are_refused(
    change: Callable[[dict[str, Any]], object], message: str
) -> None:
    contract = everything()
    document = json.loads(contract_text(plain(contract)))
    del document["sha256"]
    change(document["robots"][1])
    with pytest.raises(ValueError, match=message):
        contract_text(document)


WRONG = [
    ("own", {"heading": 1.0}, "own.heading"),
    ("own", {"ranges": [1.0]}, "own.ranges"),
    ("own", {"ranges": [-1.0] * 7}, "own.ranges.0"),
    ("own", {"turn_rate": "fast"}, "own.turn_rate"),
    ("own", {"load": 1.5}, "own.load"),
    ("teammates", {"food_0": {"since_seen": -1.0}}, "teammates.food_0.since_seen"),
    ("teammates", {"food_0": {"since_seen": 1.0, "charge": 1.0}}, "teammates.food_0.charge"),
    ("teammates", {"navigation_0": {"position": (0, 0), "velocity": (0, 0)}},
     "teammates.navigation_0.heading"),
]  # fmt: skip


@pytest.mark.parametrize(("key", "value", "field"), WRONG)
def test_wrong_readings_of_senses_are_refused_by_name(
    key: str, value: dict[str, object], field: str
) -> None:
    builder = RowBuilder(everything(), 1, max_age_s=1.0)
    body = {"position": (0.0, 0.0), "velocity": (0.0, 0.0)}
    own = body | {"heading": 0.5, "turn_rate": 0.0, "load": 0.5, "ranges": [None] * 7}
    readings: dict[str, Any] = {"own": own, "teammates": {}, "victims": []}
    builder.row(readings)
    readings[key] = readings[key] | value
    if field == "own.heading":
        del readings[key]["heading"]
    with pytest.raises(ReadingError) as caught:
        builder.row(readings)
    assert caught.value.field == field


def test_a_blackout_leaves_what_a_robot_has() -> None:
    contract = everything()
    row = RowBuilder(contract, 1, max_age_s=1.0).dark_row({"load": 0.5})
    names = [column.name for column in contract.observation]
    left = {name: value for name, value in zip(names, row.tolist(), strict=True) if value}
    healthy = {"own.fault.motor_gain": 1.0, "own.fault.speed_limit": 1.0}
    stores = {"own.charge": 1.0, "own.load": 0.5}
    assert left == {"own.ability.food": 1.0, "own.available": 1.0, **healthy, **stores}


@settings(max_examples=30)
@given(
    seed=st.integers(0, 2**32),
    robots=st.integers(1, 6),
    order=st.sampled_from(("relevant", "slot")),
)
def test_rows_of_random_teams_are_those_of_the_worlds(seed: int, robots: int, order: str) -> None:
    rng = np.random.default_rng(seed)
    team = []
    for number in range(robots):
        abilities = rng.choice(["water", "air", "rope", "light"], rng.integers(1, 4), replace=False)
        mass, speed = rng.uniform(0.3, 2.0), rng.uniform(0.2, 2.0)
        name = f"robot_{rng.integers(10)}_{number}"
        team.append(
            Robot(
                name=name, kind="any", abilities=tuple(abilities), mass_kg=mass, max_speed_mps=speed
            )
        )
    tasks = []
    for number in range(int(rng.integers(1, 4))):
        helpers = rng.permutation(robots)[: rng.integers(1, robots + 1)]
        needs = tuple(str(rng.choice(team[robot].abilities)) for robot in helpers)
        tasks.append(Task(name=f"task_{number}", needs=needs))
    scenario = Scenario(
        situation=str(rng.choice(["single", "double", "mixed"])),  # type: ignore[arg-type]
        robots=tuple(team),
        tasks=tuple(tasks),
        max_victims=int(rng.integers(1, 5)),
        victim_order=order,  # type: ignore[arg-type]
        observe_faults=bool(rng.integers(2)),
        rescue_radius_m=float(rng.uniform(0.1, 0.6)),
        episode_steps=7,
    )
    check(scenario, seed, worlds=3)
