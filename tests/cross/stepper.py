"""A second, plain reading of the rescue world in float64, to hold the compiled one against.

It covers motion without contacts, batteries, the rescue rule, sums, services and deadlines,
rewards, observations and the faults that need no random numbers. It draws nothing:
starts, and the places and deadlines of new victims, are taken from the world that is checked.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np
import rolling
from numpy.typing import NDArray

from innerattn.config import Scenario

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]

DIRECTIONS = np.array([[0, 0], [1, 0], [-1, 0], [0, 1], [0, -1]], dtype=np.float64)


@dataclass
class State:
    """E worlds: places and velocities (E, R, 2), obstacles (E, O, 2), victims (E, V) and faults
    (E, R) structured, steps done (E,), charges and loads as shares (E, R), the steps at which
    robots last saw each robot and each slot's victim (E, R, R + V), headings and turn rates (E, R),
    and who hears whom (E, R, R)."""

    positions: Array
    velocities: Array
    obstacles: Array
    victims: NDArray[np.void]
    faults: NDArray[np.void]
    steps: NDArray[np.int64]
    charge: Array
    load: Array
    last_seen: NDArray[np.int64]
    headings: Array
    turn_rates: Array
    heard: Bools

    @property
    def available(self) -> Bools:
        return np.asarray(self.faults["unavailable"] == 0)

    @property
    def able(self) -> Bools:
        """Robots that drive and help, (E, R)."""
        return np.asarray(self.available & (self.charge > 0))

    @property
    def present(self) -> Bools:
        return np.asarray(self.victims["present"])

    @property
    def places(self) -> Array:
        """Places of the victims, (E, V, 2)."""
        return np.stack([self.victims["x"], self.victims["y"]], axis=-1).astype(np.float64)


class Stepper:
    """The rules of one scenario, for E worlds at once."""

    def __init__(self, scenario: Scenario) -> None:
        self.scenario = scenario
        robots, tasks = scenario.robots, scenario.tasks
        self.grazed: Bools = np.zeros(0, bool)  # worlds in which rounding decides who meets a wall
        self.radii = np.array([robot.radius_m for robot in robots])
        self.max_speed = np.array([robot.max_speed_mps for robot in robots])
        self.sets_velocity = np.array([robot.drive == "velocity" for robot in robots])
        drives = [robot.drive for robot in robots]
        self.rolls = np.array([drive in ("unicycle", "differential") for drive in drives])
        self.layers = np.array([robot.layer for robot in robots])
        self.acceleration = np.array([robot.drive_force_n / robot.mass_kg for robot in robots])
        self.abilities = sorted({ability for robot in robots for ability in robot.abilities})
        self.able = np.array([[a in robot.abilities for a in self.abilities] for robot in robots])
        self.able = self.able.reshape(len(robots), len(self.abilities))
        self.given = np.array([[robot.amount(a) for a in self.abilities] for robot in robots])
        self.given = self.given.reshape(self.able.shape)
        self.counts = np.array([[task.amount(a) for a in self.abilities] for task in tasks])
        self.helps = (self.able[:, None, :] & (self.counts > 0)).any(-1)  # (R, T)
        # Least whole numbers of periods that last at least so long, up to rounding.
        self.service = np.array([self._periods(task.service_s) for task in tasks])
        self.restarts = np.array([task.service == "restart" for task in tasks])
        batteries = [robot.battery for robot in robots]
        self.powered = np.array([one is not None for one in batteries])
        self.capacity = np.array([one.capacity_j if one else 1.0 for one in batteries])
        self.per_m = np.array([one.per_m_j if one else 0.0 for one in batteries])
        self.idle = np.array([one.idle_w if one else 0.0 for one in batteries])
        self.full = np.array([robot.load or 0 for robot in robots])
        everyone = range(len(robots))
        self.others = np.array([[j for j in everyone if j != i] for i in everyone], dtype=int)

    def seen(self, state: State) -> tuple[Bools, Array]:
        """What each robot sees of robots and victims, and the shares of time since then, both
        (E, R, R + V), as the state has it; `seeing.py` says whether it has it right."""
        passed = (state.steps[:, None, None] - state.last_seen) * self.scenario.dt_s
        since = np.where(state.last_seen < 0, 1.0, passed / (passed + 1.0))
        return np.asarray(state.last_seen == state.steps[:, None, None]), since

    def there(self, state: State) -> Bools:
        """Robots in the arena, (E, R)."""
        leave = self.scenario.unavailable_robots == "leave"
        return state.available if leave else np.ones_like(state.available)

    def _periods(self, seconds: float) -> int:
        periods = round(seconds / self.scenario.dt_s)
        return periods if periods * self.scenario.dt_s > seconds - 1e-9 else periods + 1

    def deadline_range(self, task: int) -> tuple[int, int] | None:
        """Fewest and most steps until a victim of the task is lost."""
        given = self.scenario.tasks[task].deadline_s
        if given is None:
            return None
        low, high = given if isinstance(given, tuple) else (given, given)
        return self._periods(low), self._periods(high)

    def due(self, task: int, step: int) -> list[tuple[float, float]]:
        """Places of the victims of a task that a list lets arrive with the last of these steps."""
        name = self.scenario.tasks[task].name
        all_of = [one for one in self.scenario.arrivals if one.task == name]
        return [one.position_m for one in all_of if self._periods(one.at_s) == step]

    def is_done(self, state: State) -> Bools:
        """Whether all victims of the list have come and gone, (E,)."""
        last = max((self._periods(one.at_s) for one in self.scenario.arrivals), default=0)
        return np.asarray((state.steps >= last) & ~state.present.any(1))

    def charged(self, before: State, after: Array) -> tuple[Array, Bools]:
        """Charges after a step that ends at these places, (E, R), and where rounding might decide
        whether a robot stands at a station or is empty, (E,)."""
        dt = self.scenario.dt_s
        way = np.linalg.norm(after - before.positions, axis=-1)
        joules = before.charge * self.capacity - self.per_m * way - self.idle * dt
        given, unsure = np.zeros(way.shape), np.zeros(way.shape, dtype=bool)
        for station in self.scenario.stations:
            distance = np.linalg.norm(after - station.position_m, axis=-1)
            here = distance <= station.radius_m
            given = np.where(here, np.maximum(given, station.recharge_w * dt), given)
            unsure |= abs(distance - station.radius_m) < 1e-5
        share = np.clip((joules + given) / self.capacity, 0.0, 1.0)
        unsure |= (abs(joules + given) < 1e-5 * self.capacity) & (before.charge > 0)
        changes = self.powered & self.there(before)
        return np.where(changes, share, before.charge), (unsure & changes).any(-1)

    def reloaded(
        self, before: State, after: Array, rescues: list[tuple[int, ...]]
    ) -> tuple[Array, Bools]:
        """Loads after a step with these rescues that ends at these places, (E, R), and where
        rounding might decide whether a robot stands at a depot, (E,)."""
        loads = np.rint(before.load * np.maximum(self.full, 1))
        for env, _slot, *helpers in rescues:
            loads[env, helpers] -= self.full[helpers] > 0
        here = unsure = np.zeros(loads.shape, dtype=bool)
        for depot in self.scenario.depots:
            distance = np.linalg.norm(after - depot.position_m, axis=-1)
            here = here | (distance <= depot.radius_m)
            unsure = unsure | (abs(distance - depot.radius_m) < 1e-5)
        loads = np.where(here & self.there(before), self.full, loads)
        return np.where(self.full > 0, loads / np.maximum(self.full, 1), 1.0), unsure.any(-1)

    def drive(self, actions: NDArray[Any]) -> Array:
        """Directions whose length is the share of full force, (E, R, 2), or of robots on wheels
        the shares ahead and to the left."""
        if self.scenario.actions == "discrete":
            return np.asarray(DIRECTIONS[actions])
        length = np.linalg.norm(actions.astype(np.float64), axis=-1, keepdims=True)
        clipped = actions / np.maximum(length, 1.0)
        return np.where(self.rolls[:, None], rolling.asked(self, actions.astype(float)), clipped)

    def fly(self, state: State, drive: Array) -> tuple[Array, Array]:
        """Places and velocities after a period in which nothing touches."""
        dt, faults = self.scenario.dt_s, state.faults
        able = state.able[..., None]
        rolled, self.turned, self.rates = rolling.roll(self, state, drive * able)
        sin, cos = (f(faults["heading_bias"].astype(np.float64)) for f in (np.sin, np.cos))
        x, y = drive[..., 0], drive[..., 1]
        drive = np.stack([cos * x - sin * y, sin * x + cos * y], axis=-1)
        drive = drive * (faults["motor_gain"] * state.able)[..., None]
        velocities = (1 - self.scenario.damping) * state.velocities
        velocities = velocities + self.acceleration[:, None] * dt * drive
        set_at_once = self.max_speed[:, None] * drive
        velocities = np.where(self.sets_velocity[:, None], set_at_once, velocities)
        speed = np.linalg.norm(velocities, axis=-1)
        most = self.max_speed * faults["speed_limit"]
        too_fast = speed > most
        factor = np.where(too_fast, most / np.where(too_fast, speed, 1.0), 1.0)
        velocities = velocities * factor[..., None]
        velocities = np.where(self.rolls[:, None], rolled, velocities)
        positions = state.positions + velocities * dt
        if self.scenario.engine == "none":
            wall = self.scenario.arena_half_width_m - self.radii[:, None]
            stopped = (abs(positions) > wall) & self.there(state)[..., None]
            self.grazed = (abs(abs(positions) - wall) < 1e-6).any((-1, -2))
            positions = np.where(stopped, np.sign(positions) * wall, positions)
            velocities = np.where(stopped, 0.0, velocities)
        return positions, velocities

    def distances(self, state: State, positions: Array) -> Array:
        """Distances of robots from victims, (E, V, R)."""
        return np.linalg.norm(state.places[:, :, None] - positions[:, None], axis=-1)

    def total_distance(self, state: State, positions: Array) -> Array:
        """Σ over present victims and their needs of the nearest able robots' distances, (E,)."""
        distances = self.distances(state, positions)
        distances = np.where((state.able & (state.load > 0))[:, None], distances, np.inf)
        total = np.zeros(len(positions))
        for task, counts in enumerate(self.counts):
            mine = state.present & (state.victims["task"] == task)
            for ability, count in enumerate(counts):
                if self.scenario.tasks[task].sums:
                    order = np.argsort(distances, axis=-1, kind="stable")
                    given = self.given[order, ability]
                    short = given.cumsum(-1) - given < count - 1e-9 * count
                    nearest = np.take_along_axis(distances, order, axis=-1)
                    counted = short & (given > 0) & np.isfinite(nearest)
                    total += np.where(mine, np.where(counted, nearest, 0.0).sum(-1), 0.0).sum(-1)
                    continue
                able = distances[..., self.able[:, ability]]
                nearest = np.sort(able, axis=-1)[..., : int(count)]
                nearest = np.where(np.isfinite(nearest), nearest, 0.0).sum(-1)
                total += np.where(mine, nearest, 0.0).sum(-1)
        return total

    def met(
        self, state: State, positions: Array, charge: Array
    ) -> tuple[list[tuple[int, ...]], Bools]:
        """(env, slot, helpers...) of all victims whose needs are met by robots with a charge
        (E, R) and a load; worlds in which rounding might decide, (E,)."""
        radius = self.scenario.rescue_radius_m
        distances = self.distances(state, positions)
        close = abs(distances - radius) < 1e-5
        in_order = np.sort(distances, axis=-1)
        tied = (np.diff(in_order, axis=-1) < 1e-5) & (in_order[..., 1:] < radius)
        unsure = (state.present & (close.any(-1) | tied.any(-1))).any(-1)
        found: list[tuple[int, ...]] = []
        able = state.available & (charge > 0) & (state.load > 0)
        near = (distances <= radius) & able[:, None]
        waiting = self.waiting(state)
        for env in np.flatnonzero((state.present & near.any(-1)).any(-1)):
            busy: set[int] = set()
            for slot in np.flatnonzero(state.present[env] & ~waiting[env]):
                free = [int(r) for r in np.flatnonzero(near[env, slot]) if r not in busy]
                free.sort(key=lambda robot: (distances[env, slot, robot], robot))
                task = int(state.victims["task"][env, slot])
                if self.scenario.tasks[task].sums:
                    helpers = self._coalition(task, free)
                else:
                    helpers = self._first_team(self.scenario.tasks[task].roles, free)
                if helpers:
                    busy |= set(helpers)
                    found.append((int(env), int(slot), *helpers))
        return found, unsure

    def waiting(self, state: State) -> Bools:
        """Victims that have to wait for others, (E, V)."""
        found = np.zeros(state.victims.shape, dtype=bool)
        for index, task in enumerate(self.scenario.tasks):
            for other, name in enumerate(one.name for one in self.scenario.tasks):
                if name in task.after:
                    here, there = (
                        state.present & (state.victims["task"] == one) for one in (index, other)
                    )
                    came = np.where(there, state.victims["appeared_step"], np.iinfo(int).max)
                    found |= here & (came.min(1)[:, None] <= state.victims["appeared_step"])
        return found

    def settle(
        self, state: State, met: list[tuple[int, ...]]
    ) -> tuple[list[tuple[int, ...]], Bools, NDArray[np.int64]]:
        """What becomes of victims in a step: the rescues among those that are met, the lost (E, V),
        and the steps of service that each victim has had then (E, V)."""
        shape = state.victims.shape
        task = np.where(state.present, state.victims["task"], 0)
        served = np.zeros(shape, dtype=int)
        if self.service.any():
            served = np.rint(state.victims["served"] * np.maximum(self.service[task], 1)).astype(
                int
            )
        helped = np.zeros(shape, dtype=bool)
        for env, slot, *_ in met:
            helped[env, slot] = True
        served = np.where(helped, served + 1, np.where(self.restarts[task], 0, served))
        done = helped & (served >= self.service[task])
        lost = np.zeros(shape, dtype=bool)
        if any(one.deadline_s is not None for one in self.scenario.tasks):
            due = state.victims["deadline_step"]
            lost = state.present & ~done & (due >= 0) & (state.steps[:, None] + 1 >= due)
        return [row for row in met if done[row[0], row[1]]], lost, served

    def _first_team(self, needs: tuple[str, ...], nearest_first: list[int]) -> tuple[int, ...]:
        """The first of all teams in order of nearness, need by need, that fills every need."""
        # Others take at most len(needs) - 1 robots, so nobody farther is ever needed.
        able = [
            [r for r in nearest_first if need in self.scenario.robots[r].abilities][: len(needs)]
            for need in needs
        ]
        for team in product(*able):
            if len(set(team)) == len(team):
                return team
        return ()

    def _coalition(self, task: int, nearest_first: list[int]) -> tuple[int, ...]:
        """The shortest row of the nearest that reaches the sums, without those not needed."""
        sizes = range(1, len(nearest_first) + 1)
        team = next((row for n in sizes if self._reach(task, row := nearest_first[:n])), [])
        for robot in reversed(list(team)):
            rest = [other for other in team if other != robot]
            team = rest if self._reach(task, rest) else team
        return tuple(team)

    def _reach(self, task: int, robots: list[int]) -> bool:
        sums = [math.fsum(self.given[robots, ability]) for ability in range(len(self.abilities))]
        return all(self.counts[task] <= np.array(sums) + 1e-9 * self.counts[task])

    def reward_components(
        self,
        before: State,
        after: State,
        drive: Array,
        rescues: list[tuple[int, ...]],
        lost: Bools,
        terminated: Bools,
    ) -> dict[str, Array]:
        """Rewards by component but for the contact's, each (E, R)."""
        scenario = self.scenario
        rescue = np.zeros(before.positions.shape[:2])
        for env, _slot, *helpers in rescues:
            robots = helpers if scenario.rescue_credit == "helpers" else slice(None)
            rescue[env, robots] += scenario.rescue_reward
        start = self.total_distance(before, before.positions)
        dense = np.zeros_like(start)
        if scenario.shaping == "progress":
            dense = start - self.total_distance(before, after.positions)
        elif scenario.shaping == "potential":
            end = np.where(terminated, 0.0, self.total_distance(after, after.positions))
            dense = start - scenario.shaping_discount * end
        return {
            "rescue": rescue,
            "progress": np.broadcast_to((scenario.shaping_weight * dense)[:, None], rescue.shape),
            "action": -scenario.action_cost * (drive**2).sum(-1) * before.able,
            "lost": np.broadcast_to(-scenario.lost_cost * lost.sum(1)[:, None], rescue.shape),
        }

    def observations(self, state: State) -> tuple[Array, Bools]:
        """Rows of all robots without rays, (E, R, D); where rounding may order them, (E, R)."""
        envs, robots = state.positions.shape[:2]
        given = np.broadcast_to(self.given, (envs, *self.given.shape)).astype(np.float64)
        flags = [given, state.available[..., None]]
        if self.scenario.observe_faults:
            shown = [kind for kind in state.faults.dtype.names or () if kind != "unavailable"]
            flags += [state.faults[kind][..., None] for kind in shown]
        if self.powered.any():
            flags.append(state.charge[..., None])
        if self.full.any():
            flags.append(state.load[..., None])
        there = self.there(state)[..., None]
        known = np.concatenate(flags, axis=-1) * there
        dark = (state.faults["blackout"] == 1)[..., None]
        deaf = (state.faults["lost_communication"] == 1)[..., None]
        motion = np.concatenate([state.positions, state.velocities], axis=-1)
        blocks = [np.where(dark, 0.0, motion), known]
        tied = np.zeros((envs, robots), dtype=bool)
        ahead = np.zeros((envs, robots, 0))
        if self.rolls.any():
            ahead = np.stack([np.cos(state.headings), np.sin(state.headings)], -1)
            ahead = ahead * self.rolls[:, None] * there
            blocks.append(np.where(dark, 0.0, ahead))
        for spots in (self.scenario.stations, self.scenario.depots):
            if spots:
                ways = np.array([one.position_m for one in spots]) - state.positions[:, :, None]
                nearest = np.linalg.norm(ways, axis=-1).argmin(-1)
                way = np.take_along_axis(ways, nearest[..., None, None], 2)[:, :, 0]
                blocks.append(np.where(dark, 0.0, way))
        if self.rolls.any():
            blocks.append(np.where(dark, 0.0, state.turn_rates[..., None]))
        if robots > 1:
            relative = (motion[:, self.others] - motion[:, :, None]) * there[:, self.others]
            others = known[:, self.others], ahead[:, self.others]
            teammates = np.concatenate([relative, *others], axis=-1)
            teammates = np.where(deaf[..., None], 0.0, teammates)
            if self.scenario.has_limited_sight:
                seen, since = (
                    np.take_along_axis(values, self.others[None], 2)[..., None]
                    for values in self.seen(state)
                )
                teammates = np.concatenate([teammates * seen, seen, since], axis=-1)
            if self.scenario.limits_communication:
                heard = np.take_along_axis(state.heard, self.others[None], 2)[..., None]
                teammates = np.concatenate([teammates, heard], axis=-1)
            if self.scenario.observed_teammates is not None:
                teammates, tied = self._nearest(teammates, known.shape[-1] + ahead.shape[-1] + 4)
            blocks.append(np.where(dark, 0.0, teammates.reshape(envs, robots, -1)))
        victims, unsure = self._victims_seen(state)
        rows = np.concatenate([*blocks, np.where(dark, 0.0, victims)], axis=-1)
        return rows * there, (unsure | tied) & there[..., 0]

    def _nearest(self, teammates: Array, seen: int) -> tuple[Array, Bools]:
        """The nearest of the teammates (E, R, T, C), unknown ones last; where two are as near.

        Args:
            teammates: Their columns.
            seen: Which of the columns says whether one is seen, if sight is limited.
        """
        most = self.scenario.observed_teammates
        limited = self.scenario.has_limited_sight
        found, tied = [], []
        for row in teammates.reshape(-1, *teammates.shape[2:]):
            far = np.hypot(row[:, 0], row[:, 1])
            known = [bool(one[seen] if limited else one.any()) for one in row]
            order = sorted(range(len(row)), key=lambda k: (not known[k], far[k] if known[k] else 0))
            found.append(row[order[:most]])
            steps = np.diff([far[k] for k in order if known[k]])
            tied.append(bool((steps < 1e-5).any()))
        shape = teammates.shape[:2]
        return np.array(found).reshape(*shape, -1, teammates.shape[-1]), np.reshape(tied, shape)

    def _victims_seen(self, state: State) -> tuple[Array, Bools]:
        envs, robots = state.positions.shape[:2]
        place = state.places[:, None] - state.positions[:, :, None]  # (E, R, V, 2)
        distance = np.linalg.norm(place, axis=-1)
        there = np.broadcast_to(state.present[:, None], distance.shape)
        since = np.zeros((*distance.shape, 0))
        if self.scenario.has_limited_sight:
            seen, since = (values[..., robots:] for values in self.seen(state))
            there = there & seen
            in_order = self.scenario.victim_order == "relevant"
            since = (np.sort(since) if in_order else since)[..., None]
        needs = self.counts[state.victims["task"]]  # absent ones are blanked below
        needs = np.broadcast_to(needs[:, None], (*distance.shape, needs.shape[-1]))
        times = [
            np.broadcast_to(values[:, None, :, None], (*distance.shape, 1))
            for values in self._times_seen(state)
        ]
        if self.scenario.has_order:
            times.append(self._waiting_for_seen(state, there)[..., None])
        blocks = np.concatenate([there[..., None], needs, place, *times], axis=-1)
        blocks = blocks * there[..., None]
        unsure = np.zeros((envs, robots), dtype=bool)
        if self.scenario.victim_order == "relevant":
            helped = self.helps[:, state.victims["task"]].transpose(1, 0, 2)
            rank = np.where(there, np.where(helped, 0, 1), 2)
            key = np.where(there, distance, 0.0)
            order = np.lexsort((key, rank), axis=-1)
            blocks = np.take_along_axis(blocks, order[..., None], axis=-2)
            sort = [np.take_along_axis(values, order, axis=-1) for values in (rank, key)]
            tied = (np.diff(sort[0], axis=-1) == 0) & (np.diff(sort[1], axis=-1) < 1e-5)
            unsure = (tied & (sort[0][..., 1:] < 2)).any(-1)
        bearing = np.zeros((*distance.shape, 0))
        if self.rolls.any():
            x, y = np.moveaxis(blocks[..., 1 + needs.shape[-1] :][..., :2], -1, 0)
            cos, sin = (f(state.headings)[..., None] for f in (np.cos, np.sin))
            bearing = np.stack([cos * x + sin * y, cos * y - sin * x], -1)
            bearing = bearing * self.rolls[:, None, None]
        blocks = np.concatenate([blocks, since, bearing], axis=-1)
        blocks = blocks[:, :, : self.scenario.observed_victims]
        return blocks.reshape(envs, robots, -1), unsure

    def _times_seen(self, state: State) -> list[Array]:
        """The columns of services and deadlines that the scenario has, each (E, V)."""
        found = []
        if self.service.any():
            found.append(state.victims["served"].astype(np.float64))
        ranges = [self.deadline_range(task) for task in range(len(self.scenario.tasks))]
        if longest := max((high for _, high in filter(None, ranges)), default=0):
            due = state.victims["deadline_step"]
            left = np.clip((due - state.steps[:, None]) / longest, 0.0, 1.0)
            found.append(np.where(due < 0, 1.0, left))
        return found

    def _waiting_for_seen(self, state: State, seen: Bools) -> Array:
        """Victims that have to wait for others that a robot sees, (E, R, V)."""
        rows = []
        for own in range(seen.shape[1]):
            victims = state.victims.copy()
            victims["present"] &= seen[:, own]
            rows.append(self.waiting(replace(state, victims=victims)))
        return np.stack(rows, 1).astype(np.float64)
