"""A team that hears, measures and sees within limits."""

from innerattn.config import Scenario
from innerattn.config.communication import Communication
from innerattn.config.range_sensor import RangeSensor

AHEAD = RangeSensor(rays=7, range_m=0.9, field_of_view_deg=120.0)
AROUND = RangeSensor(rays=12, range_m=0.8)


def sensing() -> Scenario:
    """Rays ahead of robots on wheels, around one other robot, none of the last; delay and loss."""
    scenario = Scenario.preset("mixed-wheels")
    robots = [
        robot.replace(sight_m=0.7, range_sensor=AHEAD if robot.has_wheels else AROUND)
        for robot in scenario.robots
    ]
    last = max(index for index, robot in enumerate(robots) if not robot.has_wheels)
    robots[last] = robots[last].replace(range_sensor=None)
    return scenario.replace(
        robots=tuple(robots),
        communication=Communication(range_m=1.2, delay_steps=1, loss=0.2),
    )
