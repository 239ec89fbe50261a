"""The rules of a contract in sentences, by subject."""

from __future__ import annotations

from innerattn.config import Scenario

_ABOUT = {
    "frames": "World frame: origin in the centre of the arena, x and y along its walls, metres. "
    "relative_* columns are differences in axes of the world frame; nothing is rotated with the "
    "robot's heading. The ONNX files take rows in this frame and give actions in it; a frame that "
    "the team was trained in is inside them.",
    "observation": "One float32 number for each column, in this order. own.* comes from the "
    "robot's own estimate of its pose and velocity. teammate_k.* comes from the last message of "
    "the k-th other robot in the order of `robots`, minus the robot's own position or velocity. "
    "victim_k.* comes from the list of victims that are waiting.",
    "victims": "With victim_order 'relevant': first the victims that need an ability of this "
    "robot, then the others; within each the nearer first. With 'slot': as in the list. Slots "
    "without a victim are zeros.",
    "not_heard": "All columns of a teammate that is not heard are zeros, its abilities and "
    "availability too. A message older than max_age_s counts as not heard.",
    "faults": "frozen_sensor: give the row of the step before once more. blackout: zeros, except "
    "own abilities, availability and faults. unavailable: the robot's own availability is 0 in "
    "its row and in its messages. Noise needs nothing: all relative columns use the robot's own "
    "estimate.",
    "action": "One action for each control period. Its force is held for the whole period. Without "
    "contact that is the velocity clip((1 - damping) v + force * drive_force_n / mass_kg * "
    "control_period_s, max_speed_mps), set at the start of the period, where v is the present "
    "velocity and clip shortens the vector.",
    "probabilities": "softmax of the logits. With greedy_actions the likeliest action is taken, "
    "else one is drawn.",
}
_ABOUT_FORCES = _ABOUT | {
    "action": "One force for each control period, as a share of full force along x and y. A vector "
    "longer than 1 is shortened to 1. It is held for the whole period. Without contact that is the "
    "velocity clip((1 - damping) v + force * drive_force_n / mass_kg * control_period_s, "
    "max_speed_mps), set at the start of the period, where v is the present velocity and clip "
    "shortens the vector.",
    "probabilities": "The output `policy` holds means x and y, then log standard deviations x and "
    "y, of a normal distribution. Its draws go through tanh on each axis. With greedy_actions the "
    "force is tanh of the means, the output `force`, else one is drawn.",
}

_ABOUT_WHEELS = {
    "wheels": "The actions of a robot on wheels are shares that it sets: of a unicycle the speed "
    "along its heading and the turn rate, counterclockwise; of a differential drive the speeds of "
    "its left and right wheel. Let dt be control_period_s, clip(x, m) x within -m..m, and "
    "toward(a, b, m) = a + clip(b - a, m): a unicycle has the speed clip(toward(speed, "
    "share_0 * max_speed_mps, "
    "acceleration_m_s2 * dt), max_speed_mps) and the turn rate clip(toward(rate, share_1 * "
    "max_turn_rad_s, turn_acceleration_rad_s2 * dt), max_turn_rad_s) in the period. Each wheel of "
    "a differential drive follows its share of max_speed_mps like the speed of a unicycle; the "
    "speed is their mean, and the turn rate their difference by track_m, clipped to "
    "max_turn_rad_s. Where actions are continuous, both parts are shares by themselves: such a "
    "vector is not shortened.",
    "heading": "heading is the angle from the x axis, counterclockwise. Its columns are cosine and "
    "sine; zeros for a robot without wheels. victim_k.ahead and victim_k.left are the place of "
    "the victim along the robot's heading and to its left.",
}
_ABOUT_RAYS = {
    "rays": "own.ray.k is 1 - distance / range_m of the robot's k-th ray, 0 where it meets nothing "
    "within its range. angles_rad count from the heading, or from the x axis for a robot without "
    "wheels. A robot with fewer rays than columns has zeros in the rest.",
}
_ABOUT_SIGHT = {
    "sight": "A robot sees teammates and victims within sight_m and field_of_view_deg, where both "
    "are given, and nothing behind obstacles if scenario.occlusion is set. All columns of a "
    "teammate that it does not see now are zeros, but seen and since_seen. since_seen is t / (t + "
    "1 s), where t is the time since it last saw the teammate or the victim; 0 now, 1 if never in "
    "the episode. The block of a victim that it does not see, and of which nobody told it, is "
    "zeros but since_seen; with victim_order 'relevant' such blocks come last, those that were "
    "seen last first.",
}
_ABOUT_RADIO = {
    "radio": "teammate_k.heard is 1 while the robot hears that teammate. scenario.communication "
    "says within which range, how late, and whether they tell each other of victims.",
}
_ABOUT_STORES = {
    "stores": "charge and load are shares of battery_j and load, 1 for a robot without them. "
    "own.station and own.depot are the ways to the nearest of stations and depots. blackout "
    "leaves the own charge and load.",
}

_ABOUT_NEAREST = {
    "nearest": "teammate_k is the k-th nearest teammate, not the k-th in the order of `robots`: "
    "build the columns of all teammates, sort them by the length of relative_position (ties in "
    "the order of `robots`; those that are not heard, or where sight is limited not seen, come "
    "last), and keep scenario.observed_teammates of them.",
}
_ABOUT_FIRST = {
    "first": "Of the victims in their order, the first scenario.observed_victims are kept.",
}


_ABOUT_ANY = {
    "frames": "World frame: origin in the centre of the arena, x and y along its walls, metres. "
    "relative_* columns are differences in axes of the world frame; nothing is rotated with the "
    "robot's heading. Rows and actions are in this frame.",
    "any_team": "One policy acts for every robot. A robot reads its row as a table of robots and "
    "victims. A teammate tells its position, velocity and availability; its abilities come with "
    "its columns, and max_speed_mps, mass_kg and drive_force_n of all robots from `robots`. The "
    "ONNX file, if there is one, takes these tables instead of a row, of any numbers of robots and "
    "victims. The policy does not see faults and obstacles.",
    "not_heard": "All columns of a teammate that is not heard are zeros, its abilities and "
    "availability too. A message older than max_age_s counts as not heard. The robot then acts as "
    "in a team without that teammate. One that has left for good is never heard.",
    "probabilities": "The policy gives their logarithms. With greedy_actions the likeliest action "
    "is taken, else one is drawn.",
}


def about(scenario: Scenario, *, for_any_team: bool = False) -> dict[str, str]:
    """The rules by subject: those of every team, and those of what this one has.

    Args:
        scenario: the worlds.
        for_any_team: whether the policy is one for any team.
    """
    found = _ABOUT_FORCES if scenario.actions == "continuous" else _ABOUT
    if for_any_team:
        found = found | _ABOUT_ANY
    if scenario.has_wheels:
        found = found | _ABOUT_WHEELS
    if any(robot.range_sensor is not None for robot in scenario.robots):
        found = found | _ABOUT_RAYS
    if scenario.has_limited_sight:
        found = found | _ABOUT_SIGHT
    if scenario.limits_communication:
        found = found | _ABOUT_RADIO
    if any(robot.battery is not None or robot.load is not None for robot in scenario.robots):
        found = found | _ABOUT_STORES
    if scenario.observed_teammates is not None:
        found = found | _ABOUT_NEAREST
    if scenario.observed_victims is not None:
        found = found | _ABOUT_FIRST
    return found
