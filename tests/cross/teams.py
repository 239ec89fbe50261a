"""Random valid scenarios: teams of 1 to 64 robots, tasks they can serve, every option."""

from __future__ import annotations

import numpy as np

from innerattn.config import (
    Arrival,
    Battery,
    Communication,
    Depot,
    Map,
    Obstacle,
    RangeSensor,
    Robot,
    Scenario,
    Station,
    Task,
)

SIZES = (1, 2, 3, 4, 4, 5, 8, 12, 20, 64)


def random_scenario(rng: np.random.Generator) -> Scenario:
    """A scenario whose arena grows with the team, so that most steps are free of contacts."""

    def pick(*values: object) -> object:
        return values[rng.integers(len(values))]

    def between(low: float, high: float) -> float:
        return float(rng.uniform(low, high))

    size = int(pick(*SIZES))  # type: ignore[call-overload]
    arena = 0.4 + 0.6 * size**0.5
    names = ["water", "food", "rope", "light"][: rng.integers(1, 5)]
    robots = [
        Robot(
            name=f"robot_{index}",
            kind=f"kind_{index % 3}",
            abilities=tuple(rng.permutation(names)[: rng.integers(1, len(names) + 1)].tolist()),
            max_speed_mps=between(0.5, 2.0),
            mass_kg=between(0.5, 2.0),
            radius_m=between(0.03, 0.06),
            drive_force_n=between(2.0, 10.0),
        )
        for index in range(size)
    ]
    tasks = []
    for index in range(rng.integers(1, 4)):
        # Distinct robots, one ability of each: a task that can be served.
        team = rng.choice(size, size=rng.integers(1, min(size, 3) + 1), replace=False)
        needs = tuple(str(rng.choice(robots[robot].abilities)) for robot in team)
        tasks.append(Task(name=f"task_{index}", needs=needs))
    obstacles = [
        Obstacle(shape="disc", radius_m=between(0.03, 0.1)),
        Obstacle(shape="box", half_extents_m=(between(0.03, 0.1), between(0.03, 0.1))),
        Obstacle(shape="disc", radius_m=0.1, position_m=(between(-0.5, 0.5), 0.0)),
    ]
    return Scenario.model_validate(
        {
            "situation": pick("single", "double", "mixed"),
            "robots": robots,
            "tasks": tasks,
            "max_victims": pick(1, 2, 3, 6, 32),
            "obstacles": obstacles[: rng.integers(4)] if size <= 8 and rng.random() < 0.5 else [],
            "arena_half_width_m": arena,
            "rescue_radius_m": arena * between(0.1, 0.8),
            "spawn_clearance_m": pick(0.0, 0.1, 0.2),
            "wall_clearance_m": pick(0.0, 0.1),
            "episode_steps": pick(1, 10, 25, 60),
            "end_when_rescued": pick(None, None, 1, 4),
            "dt_s": pick(0.05, 0.1, 0.15),
            "substeps": pick(4, 6, 9),
            "damping": pick(0.0, 0.1, 0.25, 1.0),
            "engine": pick("rapier", "discs"),
            "actions": pick("discrete", "continuous"),
            "rescue_credit": pick("helpers", "team"),
            "rescue_reward": pick(1.0, 5.0),
            "shaping": pick("progress", "potential", "none"),
            "shaping_weight": pick(1.0, 0.3),
            "shaping_discount": pick(0.95, 1.0),
            "contact_cost": pick(0.0, 0.5),
            "action_cost": pick(0.0, 0.1),
            "victim_order": pick("relevant", "slot"),
        }
    )


def with_times(scenario: Scenario, rng: np.random.Generator) -> Scenario:
    """The same, whose tasks have services and deadlines of some kind."""
    services = (0.0, 0.1, 0.25, 0.4)
    deadlines = (None, 0.4, (0.4, 1.0), (0.5, 0.5))
    tasks = tuple(
        task.replace(
            service_s=services[rng.integers(len(services))],
            service=("keep", "restart")[rng.integers(2)],
            deadline_s=deadlines[rng.integers(len(deadlines))],
        )
        for task in scenario.tasks
    )
    return scenario.replace(tasks=tasks, lost_cost=float(rng.integers(2)) / 2)


def with_amounts(scenario: Scenario, rng: np.random.Generator) -> Scenario:
    """The same, where some robots have amounts, and some tasks need sums that the team has."""
    amounts = (0.1, 0.3, 0.7, 1.0, 1.2, 2.5)
    robots = tuple(
        robot.replace(abilities={one: amounts[rng.integers(6)] for one in robot.abilities})
        if rng.random() < 0.6
        else robot
        for robot in scenario.robots
    )
    tasks = []
    for task in scenario.tasks:
        needs = {}
        for one in sorted(set(task.needs)):
            most = sum(robot.amount(one) for robot in robots)
            needs[one] = max(0.1, round(most * rng.choice((0.1, 0.25, 0.5, 1.0)), 1))
            needs[one] = min(needs[one], most)  # rounding may go beyond
        tasks.append(task.replace(needs=needs) if rng.random() < 0.7 else task)
    return scenario.replace(robots=robots, tasks=tuple(tasks))


def with_areas(scenario: Scenario, rng: np.random.Generator) -> Scenario:
    """The same, where most tasks have an area of their own, at times with listed places in it.

    Areas are at least half as wide as the arena, so that there is room in them.
    """
    reach = scenario.arena_half_width_m - scenario.wall_clearance_m

    def area() -> tuple[float, ...]:
        sides = rng.uniform(1.0, 2.0, 2) * reach
        low = rng.uniform(-reach, reach - sides)
        return (*low.tolist(), *np.minimum(low + sides, reach).tolist())

    tasks = tuple(
        task.replace(area_m=area()) if index == 0 or rng.random() < 0.7 else task
        for index, task in enumerate(scenario.tasks)
    )
    if rng.random() < 0.7:
        whole = area() if rng.random() < 0.5 else None
        return scenario.replace(tasks=tasks, victim_area_m=whole)
    places = rng.uniform(-0.9, 0.9, (256, 2)) * reach
    free = tuple(one for one in scenario.obstacles if one.position_m is None)
    return scenario.replace(
        tasks=tasks,
        victim_places_m=tuple(map(tuple, places.tolist())),
        obstacles=free,
        max_victims=min(scenario.max_victims, 6),
    )


def with_arrivals(scenario: Scenario, rng: np.random.Generator) -> Scenario:
    """The same, where victims of each task arrive at random, of some tasks none."""
    rates = (0.0, 0.5, 2.0, 9.0)
    tasks = tuple(
        task.replace(arrival_rate_hz=rates[rng.integers(len(rates))]) for task in scenario.tasks
    )
    most = min(scenario.max_victims, 32 // len(tasks))
    return scenario.replace(situation="poisson", tasks=tasks, max_victims=most)


def with_list(scenario: Scenario, rng: np.random.Generator) -> Scenario:
    """The same, where victims arrive from a list, often several of a task at the same time."""
    most = min(scenario.max_victims, 32 // len(scenario.tasks))
    reach = scenario.arena_half_width_m - scenario.wall_clearance_m
    listed, taken = [], dict[tuple[int, str], int]()
    for _ in range(rng.integers(0, 60)):
        name, step = scenario.tasks[rng.integers(len(scenario.tasks))].name, int(rng.integers(40))
        taken[step, name] = taken.get((step, name), 0) + 1
        if taken[step, name] <= most:
            at_s = max(0.0, step - rng.choice((0.0, 0.4, 0.9))) * scenario.dt_s
            # Beside the obstacle that has a place.
            place = (
                float(rng.uniform(-reach, reach)),
                float(rng.choice((-1, 1)) * rng.uniform(0.21, reach)),
            )
            listed.append(Arrival(at_s=at_s if step else 0.0, task=name, position_m=place))
    obstacles = tuple(one for one in scenario.obstacles if one.position_m is not None)
    return scenario.replace(
        situation="listed", max_victims=most, arrivals=tuple(listed), obstacles=obstacles
    )


def with_order(scenario: Scenario, rng: np.random.Generator) -> Scenario:
    """The same, where some tasks come after others; a hidden order of all has no cycle."""
    order = rng.permutation(len(scenario.tasks)).tolist()
    tasks = list(scenario.tasks)
    for place, index in enumerate(order):
        after = tuple(tasks[other].name for other in order[:place] if rng.random() < 0.6)
        tasks[index] = tasks[index].replace(after=after)
    return scenario.replace(tasks=tuple(tasks))


def with_batteries(scenario: Scenario, rng: np.random.Generator) -> Scenario:
    """The same, where most robots have a battery, and there are up to three stations."""
    robots = [
        robot.replace(
            battery=Battery(
                capacity_j=float(rng.uniform(2.0, 8.0)),
                per_m_j=float(rng.uniform(0.0, 2.0)),
                idle_w=float(rng.uniform(0.5, 2.0)),
            )
        )
        if index == 0 or rng.random() < 0.7
        else robot
        for index, robot in enumerate(scenario.robots)
    ]
    reach = scenario.arena_half_width_m - max(robot.radius_m for robot in robots)
    stations = [
        Station(
            position_m=tuple(rng.uniform(-reach, reach, 2).tolist()),
            radius_m=float(rng.uniform(0.3, 1.0)),
            recharge_w=float(rng.uniform(1.0, 20.0)),
        )
        for _ in range(rng.integers(1, 4))
    ]
    fixed = [one for one in scenario.obstacles if one.position_m is None]
    return scenario.replace(robots=tuple(robots), stations=tuple(stations), obstacles=tuple(fixed))


def with_loads(scenario: Scenario, rng: np.random.Generator) -> Scenario:
    """The same, where most robots have a load, and there are up to three depots."""
    robots = [
        robot.replace(load=int(rng.integers(1, 4))) if index == 0 or rng.random() < 0.7 else robot
        for index, robot in enumerate(scenario.robots)
    ]
    reach = scenario.arena_half_width_m - max(robot.radius_m for robot in robots)
    depots = [
        Depot(
            position_m=tuple(rng.uniform(-reach, reach, 2).tolist()),
            radius_m=float(rng.uniform(0.2, 0.8)),
        )
        for _ in range(rng.integers(4))
    ]
    fixed = [one for one in scenario.obstacles if one.position_m is None]
    return scenario.replace(robots=tuple(robots), depots=tuple(depots), obstacles=tuple(fixed))


def with_layers(scenario: Scenario, rng: np.random.Generator) -> Scenario:
    """The same, whose robots are in up to three layers in which obstacles block some of them, and
    some of which set their velocity."""
    names = ("ground", "air", "water")
    robots = [
        robot.replace(layer=names[rng.integers(3)], drive=("force", "velocity")[rng.integers(2)])
        for robot in scenario.robots
    ]
    used = sorted({robot.layer for robot in robots})
    obstacles = [
        one.replace(layers=tuple(rng.permutation(used)[: rng.integers(1, len(used) + 1)].tolist()))
        if rng.random() < 0.6
        else one
        for one in scenario.obstacles
    ]
    return scenario.replace(robots=tuple(robots), obstacles=tuple(obstacles))


def with_wheels(scenario: Scenario, rng: np.random.Generator) -> Scenario:
    """The same, most of whose robots are on wheels of unlike limits."""
    drives = ("force", "velocity", "unicycle", "unicycle", "differential", "differential")
    most = 3.1 / scenario.dt_s
    robots = [
        robot.replace(
            drive=drives[2 + rng.integers(4)] if index == 0 else drives[rng.integers(6)],
            max_turn_rad_s=float(rng.choice((1.0, 4.0, most))),
            acceleration_m_s2=float(rng.uniform(1.0, 20.0)),
            turn_acceleration_rad_s2=float(rng.uniform(5.0, 200.0)),
            wheel_base_m=None if rng.random() < 0.5 else robot.radius_m * rng.uniform(0.5, 2.0),
        )
        for index, robot in enumerate(scenario.robots)
    ]
    return scenario.replace(robots=tuple(robots))


def with_sight(scenario: Scenario, rng: np.random.Generator) -> Scenario:
    """The same, most of whose robots see only so far, and where obstacles may hide things."""
    half = scenario.arena_half_width_m

    def sighted(robot: Robot) -> Robot:
        fan = robot.has_wheels and rng.random() < 0.5
        return robot.replace(
            sight_m=float(rng.uniform(0.1, 1.2)) * half,
            field_of_view_deg=float(rng.uniform(30.0, 330.0)) if fan else 360.0,
        )

    robots = [
        sighted(robot) if index == 0 or rng.random() < 0.7 else robot
        for index, robot in enumerate(scenario.robots)
    ]
    occlusion = bool(scenario.obstacles) and rng.random() < 0.8
    return scenario.replace(robots=tuple(robots), occlusion=occlusion)


def with_communication(scenario: Scenario, rng: np.random.Generator) -> Scenario:
    """The same, whose robots hear only some of the others; without a delay they may tell what they
    see."""
    delay = int(rng.integers(1, 4)) if rng.random() < 0.3 else 0
    radio = Communication(
        range_m=float(rng.uniform(0.2, 2.0)) * scenario.arena_half_width_m,
        delay_steps=delay,
        loss=float(rng.uniform(0.1, 0.6)) if rng.random() < 0.5 else 0.0,
        share="victims" if not delay and rng.random() < 0.8 else "nothing",
    )
    return scenario.replace(communication=radio)


def with_rays(scenario: Scenario, rng: np.random.Generator) -> Scenario:
    """The same, most of whose robots have range sensors; those on wheels may look ahead alone, and
    some look into all layers."""
    layers = tuple(sorted({robot.layer for robot in scenario.robots}))

    def sensor(robot: Robot) -> RangeSensor:
        ahead = robot.has_wheels and rng.random() < 0.6
        return RangeSensor(
            rays=int(rng.choice((1, 2, 8, 33))),
            range_m=float(rng.uniform(0.1, 3.0)),
            field_of_view_deg=float(rng.uniform(5.0, 359.0)) if ahead else 360.0,
            layers=layers if rng.random() < 0.3 else None,
        )

    robots = [
        robot.replace(range_sensor=sensor(robot)) if index == 0 or rng.random() < 0.7 else robot
        for index, robot in enumerate(scenario.robots)
    ]
    return scenario.replace(robots=tuple(robots))


def with_map(scenario: Scenario, rng: np.random.Generator) -> Scenario:
    """The same in an arena twice as wide, with a few solid blocks that some layers meet."""
    side = int(rng.integers(6, 20))
    cells = np.zeros((side, side), bool)
    for _ in range(rng.integers(1, 5)):
        row, column = rng.integers(0, side - 2, 2)
        cells[row : row + rng.integers(1, 3), column : column + rng.integers(1, 4)] = True
    rows = tuple("".join("#" if solid else "." for solid in row) for row in cells)
    layers = sorted({robot.layer for robot in scenario.robots})
    some = tuple(layers[: rng.integers(1, len(layers) + 1)]) if rng.random() < 0.5 else None
    half = 2.0 * scenario.arena_half_width_m
    radius = min(2.0 * scenario.rescue_radius_m, half)
    return scenario.replace(
        map=Map(rows=rows, layers=some), arena_half_width_m=half, rescue_radius_m=radius
    )
