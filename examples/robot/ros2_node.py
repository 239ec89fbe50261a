"""A ROS 2 node that drives one robot of an exported team. It was never run: see docs/deployment.md.

It is written against the documented API of rclpy. All poses must come in the frame of the arena;
nothing here asks tf2. Teams with limited sight or communication, batteries or loads need topics of
their own, and are refused. Start one node for each robot, with the robot's name as its namespace:

    ros2 run ... --ros-args -p team:=/path/to/export -p robot:=carrier_0 -r __ns:=/carrier_0

A robot on wheels gets ``linear.x`` and ``angular.z``; another one ``linear.x`` and ``linear.y`` in
its own frame.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import rclpy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy, qos_profile_sensor_data
from rclpy.time import Time
from sensor_msgs.msg import LaserScan
from vision_msgs.msg import Detection3DArray

from innerattn.errors import ReadingError
from innerattn.policies import Exported

STATE_TOPIC = "/team/state"
VICTIMS_TOPIC = "/victims"


class TeamMember(Node):  # type: ignore[misc]  # rclpy is not typed
    """Subscribes to what the robot senses, and publishes a command in each control period."""

    def __init__(self) -> None:
        """Read the parameters ``team`` (folder of the export) and ``robot`` (its name)."""
        super().__init__("team_member")
        folder = self.declare_parameter("team", "").value
        self._robot = str(self.declare_parameter("robot", "").value)
        self._team = Exported(folder, backend="numpy")
        members = {robot.name: robot for robot in self._team.contract.robots}
        if self._robot not in members:
            raise ValueError(f"robot = {self._robot!r}: must be one of {', '.join(members)}")
        self._member = members[self._robot]
        columns = {column.name.split(".")[1] for column in self._team.contract.observation}
        if unknown := sorted(columns & {"since_seen", "heard", "charge", "load"}):
            raise ValueError(f"team = {folder!r}: no topic gives the columns {', '.join(unknown)}")
        self._own: dict[str, Any] | None = None
        self._yaw = 0.0
        self._ranges: list[float | None] | None = None
        self._teammates: dict[str, dict[str, Any]] = {}
        self._victims: list[dict[str, Any]] = []
        self._victims_time = -math.inf

        newest = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
        self._states = self.create_publisher(Odometry, STATE_TOPIC, newest)
        self._commands = self.create_publisher(Twist, "cmd_vel", 1)
        self.create_subscription(Odometry, "odom", self._on_odom, qos_profile_sensor_data)
        self.create_subscription(Odometry, STATE_TOPIC, self._on_state, newest)
        self.create_subscription(Detection3DArray, VICTIMS_TOPIC, self._on_victims, 1)
        if self._member.range_sensor is not None:
            self.create_subscription(LaserScan, "scan", self._on_scan, qos_profile_sensor_data)
        self.create_timer(self._team.contract.control_period_s, self._decide)

    def _on_odom(self, message: Odometry) -> None:
        """The robot's own pose and motion; tell the teammates."""
        body, self._yaw, turn_rate = _body_of(message, self._member.has_wheels)
        self._own = body | ({"turn_rate": turn_rate} if self._member.has_wheels else {})
        message.child_frame_id = self._robot
        self._states.publish(message)

    def _on_state(self, message: Odometry) -> None:
        """The pose and motion of a teammate, by its name in ``child_frame_id``."""
        name = message.child_frame_id
        wheels = {one.name: one.has_wheels for one in self._team.contract.robots}
        if name in wheels and name != self._robot:
            self._teammates[name] = _body_of(message, wheels[name])[0]

    def _on_victims(self, message: Detection3DArray) -> None:
        """All victims that wait: the class of a detection is the name of its task."""
        self._victims_time = _seconds(message.header.stamp)
        self._victims = [
            {
                "task": one.results[0].hypothesis.class_id,
                "position": (one.bbox.center.position.x, one.bbox.center.position.y),
            }
            for one in message.detections
        ]

    def _on_scan(self, message: LaserScan) -> None:
        """The readings of a scanner at the angles of the team's rays."""
        sensor = self._member.range_sensor
        assert sensor is not None
        turn = 0.0 if self._member.has_wheels else -self._yaw  # rays without a heading: world axes
        self._ranges = [range_at(message, angle + turn) for angle in sensor.angles_rad]

    def _decide(self) -> None:
        """Choose and publish the command of this control period; stop if a reading is missing."""
        command = Twist()
        try:
            if self._own is None:
                raise ReadingError("own", "is missing: no odometry yet")
            decision = self._team.decide(self._robot, self._readings())
            _set_command(command, self._team, self._robot, decision.force, self._own, self._yaw)
        except ReadingError as error:
            self.get_logger().warning(str(error), throttle_duration_sec=1.0)
        self._commands.publish(command)

    def _readings(self) -> dict[str, Any]:
        assert self._own is not None
        own = self._own | ({} if self._ranges is None else {"ranges": self._ranges})
        return {
            "now": self.get_clock().now().nanoseconds * 1e-9,
            "own": own,
            "teammates": self._teammates,
            "victims": self._victims,
            "victims_time": self._victims_time,
        }


def _seconds(stamp: Any) -> float:
    return float(Time.from_msg(stamp).nanoseconds) * 1e-9


def _body_of(message: Odometry, wheels: bool) -> tuple[dict[str, Any], float, float]:
    """A robot's readings, its yaw [rad] and its turn rate [rad/s].

    The twist of an Odometry is in the child frame: it is turned into the axes of the arena.
    """
    pose, twist = message.pose.pose, message.twist.twist
    turn = pose.orientation
    yaw = math.atan2(2.0 * (turn.w * turn.z + turn.x * turn.y), 1.0 - 2.0 * (turn.y**2 + turn.z**2))
    cos, sin = math.cos(yaw), math.sin(yaw)
    ahead, left = twist.linear.x, twist.linear.y
    body: dict[str, Any] = {
        "position": (pose.position.x, pose.position.y),
        "velocity": (cos * ahead - sin * left, sin * ahead + cos * left),
        "time": _seconds(message.header.stamp),
    }
    return body | ({"heading": yaw} if wheels else {}), yaw, float(twist.angular.z)


def range_at(scan: LaserScan, angle: float) -> float | None:
    """The reading nearest to an angle from straight ahead [m]; None where it met nothing."""
    turn = 2.0 * math.pi
    index = round(((angle - scan.angle_min) % turn) / scan.angle_increment)
    if index >= len(scan.ranges):
        return None
    found = float(scan.ranges[index])
    return found if scan.range_min <= found <= scan.range_max else None


def _set_command(
    command: Twist,
    team: Exported,
    robot: str,
    force: np.ndarray,
    own: dict[str, Any],
    yaw: float,
) -> None:
    """Fill in what the action asks of the robot's own controller."""
    cos, sin = math.cos(yaw), math.sin(yaw)
    if "turn_rate" in own:
        vx, vy = own["velocity"]
        speed, turn = team.twist_command(robot, force, (cos * vx + sin * vy, own["turn_rate"]))
        command.linear.x, command.angular.z = float(speed), float(turn)
        return
    x, y = team.velocity_command(robot, force, own["velocity"])
    command.linear.x, command.linear.y = float(cos * x + sin * y), float(cos * y - sin * x)


def main() -> None:
    """Run the node until it is shut down."""
    rclpy.init()
    node = TeamMember()
    try:
        rclpy.spin(node)
    except KeyboardInterrupt:
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
