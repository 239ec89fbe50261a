"""A robot's row as a table of its team and one of its victims, for policies for any team."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from innerattn.errors import ReadingError
from innerattn.policies.exported.contract import MOST_NEEDS, Contract
from innerattn.policies.exported.layout import layout_of
from innerattn.policies.exported.motion import final_speed_and_lag

Array = NDArray[np.float32]


ENDLESS_S = 1e3
"""Time until a victim without a deadline is lost [s]."""
_MOST_NUMBER = 1e9
"""Largest number of a row that a robot acts on."""


class Table(NamedTuple):
    """What one robot sees of R robots, itself first, and of the M victims that wait.

    Attributes:
        places: (2, R) float32, x and y of robots [m].
        velocities: (2, R) float32 [m/s].
        abilities: (R, K) float32, what robots that are available offer, else 0.
        there: R flags, which robots are in the arena and heard.
        victims: (2, M) float32, x and y of victims [m].
        needs: (M, K) float32, how many robots or how much of each ability a victim needs.
        waits: (M, 3) float32, service that a victim still needs [s], time until it is lost [s],
            `ENDLESS_S` where it never is, and 1 if it is blocked, else 0; None where no victim of
            this team ever has any of it.
    """

    places: Array
    velocities: Array
    abilities: Array
    there: list[bool]
    victims: Array
    needs: Array
    waits: Array | None = None


class Bodies(NamedTuple):
    """What is known of R robots beforehand, (R,) float32 each.

    Attributes:
        speed: final speed at full drive [m/s].
        lag: time that a start from rest costs against it [s].
        push: what one control period of full drive adds to the speed [m/s].
        kept: share of the speed that is kept from one period to the next.
        limit: of the speed [m/s].
        reach: how long a robot moves on at a speed, if it coasts after one period [s].
    """

    speed: Array
    lag: Array
    push: Array
    kept: Array
    limit: Array
    reach: Array


class TableReader:
    """Reads the rows of one robot.

    Attributes:
        order: numbers of the robots in the contract, as rows have them: its own, then the others.
    """

    def __init__(self, contract: Contract, robot: int) -> None:
        """Find the columns of the robot with this number.

        Raises:
            ValueError: the columns of the contract are not those of its team.
        """
        layout = layout_of(contract)
        robots = len(contract.robots)
        self.order = [robot, *(one for one in range(robots) if one != robot)]
        # Columns of each robot's place, velocity, abilities and availability, and of each victim's
        # presence, needs and place, as (R, 5 + K) and (V, 3 + K).
        begin = layout.own + (robots - 1) * layout.mate
        blocks = [0, *range(layout.own, begin, layout.mate)]
        self._team = np.add.outer(blocks, np.arange(layout.available + 1))
        slots = begin + np.arange(contract.victim_slots) * layout.victim
        self._victims = np.add.outer(slots, np.arange(layout.place + 2))
        rules = contract.network.pairs
        assert rules is not None  # as such a policy has them
        self._leave = rules.robots_leave
        first = layout.place + 2
        self._times = {name: first + number for number, name in enumerate(layout.times)}
        if self._times:
            slots = begin + np.arange(contract.victim_slots) * layout.victim
            self._victims = np.add.outer(slots, np.arange(first + len(self._times)))
        self._place = layout.place
        self._deadline = np.float32(rules.longest_deadline_s)
        self._services: dict[bytes, float] = {}
        for task, service in zip(contract.tasks, rules.services_s):
            needs = np.array([task.amount(one) for one in contract.abilities], np.float32).tobytes()
            self._services[needs] = max(service, self._services.get(needs, 0.0))

    def table(self, row: Array) -> Table:
        """The table of a row (D,)."""
        team = row.take(self._team)
        available = team[:, -1] > 0.5
        there: list[bool] = available.tolist()
        if not self._leave and False in there:  # nothing is known of who is not heard
            heard: list[bool] = np.asarray(team[1:].any(axis=1)).tolist()
            there = [True, *heard]
        team[1:, :4] += team[0, :4]
        victims = row.take(self._victims)
        victims = victims.compress(victims[:, 0] > 0.5, axis=0)
        return Table(
            places=team[:, :2].T,
            velocities=team[:, 2:4].T,
            abilities=team[:, 4:-1] * available[:, None],
            there=there,
            victims=(victims[:, self._place : self._place + 2] + team[0, :2]).T,
            needs=victims[:, 1 : self._place],
            waits=self._waits(victims) if self._times else None,
        )

    def _waits(self, victims: Array) -> Array:
        """As `Table.waits`, from the columns of victims."""
        found = np.zeros((len(victims), 3), np.float32)
        found[:, 1] = ENDLESS_S
        times = self._times
        if "served" in times:
            left = np.float32(1.0) - victims[:, times["served"]]
            needs = (one.tobytes() for one in victims[:, 1 : self._place])
            services = [self._services.get(one, 0.0) for one in needs]
            found[:, 0] = left * np.array(services, np.float32)
        if "time_left" in times:
            share = victims[:, times["time_left"]]
            found[:, 1] = np.where(share < 1.0, share * self._deadline, np.float32(ENDLESS_S))
        if "blocked" in times:
            found[:, 2] = victims[:, times["blocked"]]
        return found


def refuse_too_many_needs(needs: Array) -> None:
    """Refuse a victim with more needs (M, K) than a policy for any team knows.

    Raises:
        ReadingError: one needs more than `MOST_NEEDS` abilities.
    """
    most = int((needs > 0.0).sum(axis=1).max(initial=0))
    if most > MOST_NEEDS:
        said = f"has a victim that needs {most} abilities: must be at most {MOST_NEEDS}"
        raise ReadingError("row", said)


def too_large(row: Array) -> bool:
    """Whether a row has a number that is not finite, or for which float32 does not suffice."""
    return not -_MOST_NUMBER < row.min() <= row.max() < _MOST_NUMBER


def bodies_of(contract: Contract, order: list[int]) -> Bodies:
    """The bodies of robots, in an order of their numbers."""
    robots = [contract.robots[number] for number in order]
    dt = contract.control_period_s
    push = np.array([robot.drive_force_n / robot.mass_kg * dt for robot in robots])
    limit = np.array([robot.max_speed_mps for robot in robots])
    kept = np.full(len(robots), 1.0 - contract.damping)
    speed, lag = final_speed_and_lag(kept, push, limit, dt)
    known = (speed, lag, push, kept, limit, dt * (1.0 + kept))
    return Bodies(*(one.astype(np.float32) for one in known))


def demand_of(contract: Contract) -> Array:
    """How much of each ability a victim needs on average over the tasks, (K,) float32."""
    tasks = contract.tasks
    sums = [sum(task.amount(one) for task in tasks) for one in contract.abilities]
    return np.array([total / len(tasks) for total in sums], np.float32)
