"""The rescue world's rules once more, plainly and in float64, as the scenario reference tells them.

It knows no contacts: `may_touch` says where they cannot be ruled out. Where and of which task new
victims are, the caller must say. Arrays have a leading axis of E worlds; rescues are settled for
one world at a time, by trying every assignment of robots to needs.
"""

from itertools import product

import numpy as np

from innerattn.config import Scenario

DIRECTIONS = np.array([(0, 0), (1, 0), (-1, 0), (0, 1), (0, -1)], float)
NOTHING = 1e9


class Stepper:
    def __init__(self, scenario: Scenario) -> None:
        self.scenario = scenario
        team = scenario.robots
        self.abilities = sorted({ability for robot in team for ability in robot.abilities})
        self.able = np.array([[a in robot.abilities for a in self.abilities] for robot in team])
        self.needs = [[self.abilities.index(a) for a in task.needs] for task in scenario.tasks]
        self.counts = np.array(
            [[task.count(a) for a in range(len(self.abilities))] for task in self.needs]
        )
        self.radius = np.array([robot.radius_m for robot in team])
        self.push = np.array([robot.drive_force_n / robot.mass_kg for robot in team])
        self.top = np.array([robot.max_speed_mps for robot in team])

    def drive(self, actions: np.ndarray) -> np.ndarray:
        """The commanded vectors (E, R, 2), of length 1 at most."""
        if self.scenario.actions == "discrete":
            return DIRECTIONS[actions]
        return shortened(actions.astype(float), 1.0)

    def fly(self, positions: np.ndarray, velocities: np.ndarray, drive: np.ndarray) -> tuple:
        dt = self.scenario.dt_s
        faster = (1 - self.scenario.damping) * velocities + self.push[:, None] * drive * dt
        velocities = shortened(faster, self.top[:, None])
        return positions + velocities * dt, velocities

    def may_touch(
        self, before: np.ndarray, after: np.ndarray, obstacles: np.ndarray, margin: float
    ) -> np.ndarray:
        """(E,) whether anything comes within ``margin`` of touching on the straight way."""
        start = before[:, :, None] - before[:, None]
        way = (after - before)[:, :, None] - (after - before)[:, None]
        gap = nearest(start, way) - self.radius[:, None] - self.radius
        gap[:, np.arange(len(self.radius)), np.arange(len(self.radius))] = NOTHING
        walls = self.scenario.arena_half_width_m - self.radius
        reach = np.maximum(abs(before), abs(after)).max(-1)
        close = (gap < margin).any((1, 2)) | (reach > walls - margin).any(1)
        for number, obstacle in enumerate(self.scenario.obstacles):
            size = obstacle.radius_m or np.hypot(*obstacle.half_extents_m)
            start = before - obstacles[:, number, None]
            room = nearest(start, after - before) - self.radius - size
            close |= (room < margin).any(1)
        return close

    def settle(self, distance: np.ndarray, tasks: np.ndarray) -> list[tuple[int, tuple]]:
        """(slot, helpers) of a world's rescues; distance (V, R), tasks (V,), -1 where absent."""
        rescues = []
        busy: set[int] = set()
        for slot, task in enumerate(tasks):
            if task < 0:
                continue
            near = distance[slot] <= self.scenario.rescue_radius_m
            candidates = [
                [r for r in np.flatnonzero(near & self.able[:, need]) if r not in busy]
                for need in self.needs[task]
            ]
            fitting = [chosen for chosen in product(*candidates) if len({*chosen}) == len(chosen)]
            if fitting:
                # Every need in turn wants the nearest robot, the first of equally near ones.
                helpers = min(fitting, key=lambda them: [(distance[slot][r], r) for r in them])
                busy |= {*helpers}
                rescues.append((slot, tuple(int(robot) for robot in helpers)))
        return rescues

    def way_to_go(self, distance: np.ndarray, tasks: np.ndarray) -> np.ndarray:
        """(E,) the distances of the nearest robots, summed over victims' needs; from (E, V, R)."""
        total = np.zeros(len(distance))
        for task, counts in enumerate(self.counts):
            for ability in np.flatnonzero(counts):
                of_able = np.sort(distance[:, :, self.able[:, ability]], axis=-1)
                least = of_able[:, :, : counts[ability]].sum(-1)
                total += np.where(tasks == task, least, 0.0).sum(-1)
        return total

    def rewards(
        self,
        drive: np.ndarray,
        rescues: list[list[tuple[int, tuple]]],
        ways: tuple[np.ndarray, np.ndarray, np.ndarray],
        terminated: np.ndarray,
    ) -> np.ndarray:
        """(E, R, 4) by component where nothing touches.

        ``ways`` are `way_to_go` before the step, after it for the same victims, and after it for
        the victims who are there then.
        """
        scenario = self.scenario
        parts = np.zeros((*drive.shape[:2], 4))
        for world, events in enumerate(rescues):
            for _, helpers in events:
                credited = list(helpers) if scenario.rescue_credit == "helpers" else slice(None)
                parts[world, credited, 0] += scenario.rescue_reward
        before, same, after = ways
        dense = {
            "progress": before - same,
            "potential": before - scenario.shaping_discount * np.where(terminated, 0.0, after),
            "none": np.zeros_like(before),
        }[scenario.shaping]
        parts[:, :, 1] = scenario.shaping_weight * dense[:, None]
        parts[:, :, 3] = -scenario.action_cost * (drive**2).sum(-1)
        return parts

    def names(self) -> list[str]:
        plane, ability = ("x", "y"), [f"ability.{a}" for a in self.abilities]
        own = [f"own.{what}.{c}" for what in ("position", "velocity") for c in plane]
        own += [f"own.{a}" for a in ability] + ["own.available"]
        mates = [
            f"teammate_{k}.{column}"
            for k in range(len(self.radius) - 1)
            for column in (
                *(f"relative_{what}.{c}" for what in ("position", "velocity") for c in plane),
                *ability,
                "available",
            )
        ]
        victims = [
            f"victim_{k}.{column}"
            for k in range(self.scenario.num_victims)
            for column in (
                "present",
                *(f"need.{a}" for a in self.abilities),
                *(f"relative_position.{c}" for c in plane),
            )
        ]
        return own + mates + victims

    def observations(
        self, positions: np.ndarray, velocities: np.ndarray, places: np.ndarray, tasks: np.ndarray
    ) -> np.ndarray:
        """(E, R, D); victims at places (E, V, 2) of tasks (E, V), -1 where absent."""
        envs, robots = positions.shape[:2]
        here = np.ones((envs, 1))
        rows = []
        for robot in range(robots):
            row = [positions[:, robot], velocities[:, robot], here * self.able[robot], here]
            for mate in range(robots):
                if mate != robot:
                    row.append(positions[:, mate] - positions[:, robot])
                    row.append(velocities[:, mate] - velocities[:, robot])
                    row += [here * self.able[mate], here]
            order = self.order(robot, positions[:, robot], places, tasks)
            for slot in order.T:
                task = np.take_along_axis(tasks, slot[:, None], 1)
                place = np.take_along_axis(places, slot[:, None, None], 1)[:, 0]
                there = task >= 0
                row.append(there)
                row.append(there * self.counts[task[:, 0]])
                row.append(there * (place - positions[:, robot]))
            rows.append(np.concatenate(row, 1))
        return np.stack(rows, 1)

    def order(
        self, robot: int, position: np.ndarray, places: np.ndarray, tasks: np.ndarray
    ) -> np.ndarray:
        """(E, V) the slots in the order in which a robot sees them."""
        slots = np.broadcast_to(np.arange(tasks.shape[1]), tasks.shape)
        if self.scenario.victim_order == "slot":
            return slots
        helpful = ((self.counts > 0) & self.able[robot]).any(1)[tasks]
        far = np.linalg.norm(places - position[:, None], axis=-1)
        return np.lexsort((slots, far, ~helpful, tasks < 0), axis=-1)


def shortened(vectors: np.ndarray, most: np.ndarray | float) -> np.ndarray:
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return vectors * np.minimum(1.0, most / np.maximum(length, 1e-300))


def distances(positions: np.ndarray, places: np.ndarray) -> np.ndarray:
    """(E, V, R) of robots (E, R, 2) and victims (E, V, 2)."""
    return np.linalg.norm(positions[:, None] - places[:, :, None], axis=-1)


def nearest(start: np.ndarray, way: np.ndarray) -> np.ndarray:
    """The least distance from the origin of points that move straight by ``way``."""
    squared = np.maximum((way**2).sum(-1), 1e-300)
    when = np.clip(-(start * way).sum(-1) / squared, 0.0, 1.0)
    return np.linalg.norm(start + when[..., None] * way, axis=-1)
