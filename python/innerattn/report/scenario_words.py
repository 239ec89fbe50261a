"""What a team can and cannot do in a scenario, and what its faults are, in words."""

from __future__ import annotations

import math
from collections.abc import Iterator

from innerattn.config import Fault, Robot, Scenario, Task
from innerattn.report.reachability import closed_off

_WHAT = {
    "motor_gain": "has {percent} of its force",
    "speed_limit": "reaches {percent} of its highest speed",
    "heading_bias": "drives {degrees} beside its heading",
    "position_noise": "sees places with an error of {value:g} m",
    "velocity_noise": "sees velocities with an error of {value:g} m/s",
    "frozen_sensor": "sees the same as before in {percent} of the steps",
    "blackout": "sees nothing in {percent} of the steps",
    "unavailable": "is out in {percent} of the steps",
    "lost_communication": "hears nobody in {percent} of the steps",
}


def scenario_words(scenario: Scenario) -> str:
    """Sentences, a line each: tasks and who can do them, stores, layers, senses, doubts, faults."""
    faults = map(_fault, scenario.faults)
    gone = ["Robots that are out are not in the arena."] if scenario.robots_leave else []
    who = [*_tasks(scenario), *_end(scenario), *_stores(scenario), *_motion(scenario)]
    who += [*_sight(scenario), *_rays(scenario), *_communication(scenario)]
    return "\n".join([*who, *_doubts(scenario), *faults, *gone])


def _tasks(scenario: Scenario) -> Iterator[str]:
    for task in scenario.tasks:
        helpers = []
        for need, amount in task.sums.items():
            given = {robot.name: robot.amount(need) for robot in scenario.robots}
            some = ", ".join(f"{name} {one:g}" for name, one in given.items() if one > 0.0)
            helpers.append(f"{amount:g} {need} (of {some})")
        for need in dict.fromkeys(task.roles):
            able = [robot.name for robot in scenario.robots if need in robot.abilities]
            count = task.roles.count(need)
            some = " or ".join(able) if count == 1 else f"{count} of {', '.join(able)}"
            helpers.append(f"{need} ({some})")
        near = f"together within {scenario.rescue_radius_m:g} m"
        arrivals = ""
        if scenario.has_arrivals:
            number = str(sum(one.task == task.name for one in scenario.arrivals))
            if scenario.situation == "poisson":
                number = f"{task.arrival_rate_hz:g} a second"
            arrivals = f"; {number} arrive, at most {scenario.max_victims} wait at once"
        yield f"{task.name}: {' and '.join(helpers)}, {near}{_times(task)}{_where(task)}{arrivals}"


def _end(scenario: Scenario) -> Iterator[str]:
    if scenario.end_when_done:
        yield (
            f"{len(scenario.arrivals)} victims in all; an episode ends when each was rescued, "
            "lost or turned away"
        )


def _where(task: Task) -> str:
    if task.area_m is None:
        return ""
    left, bottom, right, top = task.area_m
    return f"; its victims appear from ({left:g}, {bottom:g}) to ({right:g}, {top:g})"


def _times(task: Task) -> str:
    words = ""
    if task.service_s > 0.0:
        kept = "it goes on later" if task.service == "keep" else "it starts anew"
        words += f", for {task.service_s:g} s; if they leave, {kept}"
    if task.deadlines_s:
        low, high = task.deadlines_s
        words += f"; lost after {low:g} s" if low == high else f"; lost after {low:g} to {high:g} s"
    if task.after:
        words += f"; after {' and '.join(task.after)}"
    return words


def _stores(scenario: Scenario) -> Iterator[str]:
    until = "it goes to a depot" if scenario.depots else "with none: there is no depot"
    for robot in scenario.robots:
        if robot.battery is not None:
            yield f"{robot.name}: drives {_reach_m(robot):.3g} m with a full battery"
        if robot.load is not None:
            rescues = "1 rescue" if robot.load == 1 else f"{robot.load} rescues"
            yield f"{robot.name}: helps with {rescues}, then {until}"


_HARDLY, _EASILY = 1.2, 1.5
"""Rescue radii, as shares of that at which two helpers touch: up to the first they rarely meet."""
_WHEELS = {
    "unicycle": "the speed along a heading and the turn rate",
    "differential": "the speeds of two wheels",
}
"""What actions set of robots with a heading, by their drive."""


def _motion(scenario: Scenario) -> Iterator[str]:
    """Who touches whom, and what actions set but forces."""
    layers = scenario.layers
    for layer in layers if len(layers) > 1 else ():
        robots = ", ".join(robot.name for robot in scenario.robots if robot.layer == layer)
        yield f"layer {layer}: {robots}; they touch no robot of another layer"
    for index, one in enumerate(scenario.obstacles):
        if passing := [layer for layer in layers if not one.blocks(layer)]:
            yield f"obstacles[{index}]: robots of {' and '.join(passing)} pass it"
    if quick := [robot.name for robot in scenario.robots if robot.drive == "velocity"]:
        yield f"{', '.join(quick)}: actions set the velocity"
    for drive, what in _WHEELS.items():
        if rolling := [robot.name for robot in scenario.robots if robot.drive == drive]:
            yield f"{', '.join(rolling)}: actions set {what}"


def _sight(scenario: Scenario) -> Iterator[str]:
    """Who sees how far, and what is in the way."""
    limits = dict.fromkeys(map(_limits, filter(lambda one: one.has_limited_sight, scenario.robots)))
    for limit in limits:
        robots = ", ".join(one.name for one in scenario.robots if _limits(one) == limit)
        sight_m, degrees = limit
        far = "" if sight_m is None else f" up to {sight_m:g} m away"
        wide = f" within {degrees:g} degrees ahead" if degrees < 360.0 else ""
        yield f"{robots}: sees teammates and victims{far}{wide}"
    if scenario.occlusion:
        hiding = ["obstacles"] * bool(scenario.obstacles) + ["solid cells"] * bool(scenario.map)
        yield f"{' and '.join(hiding).capitalize()} hide what is behind them."


def _limits(robot: Robot) -> tuple[float | None, float]:
    """How far it sees, and within which angle [m, degrees]."""
    return robot.sight_m, robot.field_of_view_deg


def _rays(scenario: Scenario) -> Iterator[str]:
    """Who measures distances, how far, and of what."""
    for sensor in dict.fromkeys(one.range_sensor for one in scenario.robots if one.range_sensor):
        robots = ", ".join(one.name for one in scenario.robots if one.range_sensor == sensor)
        one = sensor.rays == 1
        rays, measure = ("1 ray", "measures") if one else (f"{sensor.rays} rays", "measure")
        if sensor.field_of_view_deg < 360.0:
            rays += f" over {sensor.field_of_view_deg:g} degrees"
        met = f" in {' and '.join(sensor.layers)}" if sensor.layers else ""
        yield f"{robots}: {rays} {measure} how far things{met} are, up to {sensor.range_m:g} m"


def _communication(scenario: Scenario) -> Iterator[str]:
    """Who hears whom, when, and what robots tell each other."""
    found = scenario.communication
    if found is None:
        return
    if found.range_m is not None:
        yield f"Robots hear each other up to {found.range_m:g} m away."
    if found.delay_steps:
        yield f"Robots hear what was sent {found.delay_steps * scenario.dt_s:g} s before."
    if found.loss > 0.0:
        yield f"Of what robots send, {found.loss:.3g} is lost."
    if found.share == "victims":
        yield "Robots tell those who hear them which victims they see."


def _reach_m(robot: Robot) -> float:
    """How far a robot drives at its highest speed with a full battery [m]."""
    if robot.battery is None:
        return math.inf
    return robot.battery.capacity_j / (
        robot.battery.per_m_j + robot.battery.idle_w / robot.max_speed_mps
    )


def _too_far(scenario: Scenario) -> Iterator[str]:
    """Robots whose full battery takes them to no station again from the farthest victims."""
    if not scenario.stations:
        return
    areas = dict.fromkeys(map(scenario.area_of, scenario.tasks))
    corners = [(x, y) for area in areas for x in area[::2] for y in area[1::2]]
    places = scenario.only_places_m or corners

    def apart(place: tuple[float, float]) -> float:
        ways = (math.dist(place, one.position_m) - one.radius_m for one in scenario.stations)
        return max(min(ways) - scenario.rescue_radius_m, 0.0)

    x, y = farthest = max(places, key=apart)
    for robot in scenario.robots:
        if _reach_m(robot) < 2.0 * apart(farthest):
            yield (
                f"{robot.name}: from a victim at [{x:g}, {y:g}] its full battery brings it back "
                "to no station"
            )


def _doubts(scenario: Scenario) -> Iterator[str]:
    needed = {need for task in scenario.tasks for need in task.needs}
    for robot in scenario.robots:
        if not needed & set(robot.abilities):
            yield f"{robot.name}: has no ability that a task needs"
        if robot.drive_force_n == 0.0 and robot.drive == "force":
            yield f"{robot.name}: cannot move, its drive_force_n is 0"
        if _reach_m(robot) < scenario.arena_half_width_m:
            yield (
                f"{robot.name}: its battery hardly lasts; the arena is "
                f"{2.0 * scenario.arena_half_width_m:g} m wide"
            )
    idle = [robot.battery.idle_w for robot in scenario.robots if robot.battery is not None]
    for index, station in enumerate(scenario.stations):
        if station.recharge_w <= min(idle):
            yield f"stations[{index}]: gives no more than the {min(idle):g} W that robots there use"
    yield from _too_far(scenario)
    last_s = max((one.at_s for one in scenario.arrivals), default=0.0)
    time_s = scenario.episode_steps * scenario.dt_s
    if scenario.end_when_done and last_s > time_s:
        yield f"end_when_done: a victim arrives after {last_s:g} s, and time is up at {time_s:g} s"
    for task in scenario.tasks:
        able = [robot for robot in scenario.robots if set(task.needs) & set(robot.abilities)]
        least = sum(sorted(robot.radius_m for robot in able)[:2]) / 2.0
        overlap = len({robot.layer for robot in able}) > 1 or scenario.engine == "none"
        several = _needs_several(task, scenario) and not overlap
        if several and scenario.rescue_radius_m < _HARDLY * least:
            yield (
                f"{task.name}: helpers hardly meet; without overlap of bodies rescue_radius_m "
                f"must be above {least:g}, and {_EASILY * least:.3g} gives them room"
            )
    largest = max(robot.radius_m for robot in scenario.robots)
    beyond = math.sqrt(2.0) * max(0.0, largest - scenario.wall_clearance_m)
    free = scenario.victim_area_m is None and not scenario.victim_places_m
    free = free and any(task.area_m is None for task in scenario.tasks)
    if free and beyond > scenario.rescue_radius_m:
        yield (
            "victims in a corner: a robot as large as the largest cannot reach them; "
            f"wall_clearance_m = {largest:g} would do"
        )
    yield from closed_off(scenario)


def _needs_several(task: Task, scenario: Scenario) -> bool:
    """Whether no robot alone can rescue its victims."""
    if not task.sums:
        return len(task.needs) > 1
    return not any(
        all(robot.amount(need) >= amount for need, amount in task.sums.items())
        for robot in scenario.robots
    )


def _fault(fault: Fault) -> str:
    what = _WHAT[fault.kind].format(
        value=fault.value,
        percent=f"{100.0 * fault.value:.3g} %",
        degrees=f"{math.degrees(fault.value):.3g} degrees",
    )
    if fault.onset_rate_hz is not None:
        when = f"from step {fault.onset_step} on at random, {fault.onset_rate_hz:g} times a second"
    else:
        when = f"from step {fault.onset_step} on"
    if fault.duration_steps is not None:
        when += f", for {fault.duration_steps} steps"
    return f"{fault.robot}: {what} {when}"
