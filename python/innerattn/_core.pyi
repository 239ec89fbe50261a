"""Types and shapes of the compiled half of innerattn. Use it through `innerattn.envs.BatchEnv`."""

from collections.abc import Sequence
from typing import final

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = [
    "FAULT_KINDS",
    "ORDER_FEATURES",
    "REWARD_COMPONENTS",
    "Batch",
    "Dispatcher",
    "Instance",
    "Orders",
    "Routes",
    "Rules",
    "__version__",
]

__version__: str

FAULT_KINDS: tuple[tuple[str, str, float, float, float, str], ...]
"""Name, unit ("" for a share), least, most and healthy value, and meaning of each kind of fault."""

ORDER_FEATURES: int
"""Numbers that are known of a task that could come next in an order."""

REWARD_COMPONENTS: tuple[tuple[str, str], ...]
"""Name and meaning of each reward component, in the order of their columns."""

@final
class Rules:
    """A valid scenario, ready to play. It never changes, and copies of it are the same object.

    Raises:
        ValueError: (of `Rules(json)`) one line that names the key, its value and what is allowed.
    """

    def __new__(cls, json: str) -> Rules: ...
    def to_json(self) -> str:
        """The scenario with every key written out."""

    @property
    def max_helpers(self) -> int:
        """Most robots that can help one victim."""

    @property
    def num_victims(self) -> int:
        """Victim slots V."""

    def map_boxes(self) -> list[list[float]]:
        """The map's solid cells as few boxes: centre x, y and half extents x, y of each [m]."""

    def __eq__(self, other: object, /) -> bool:
        """Whether the other is the same scenario."""

    def __copy__(self) -> Rules: ...
    def __deepcopy__(self, memo: object) -> Rules: ...
    def __getnewargs__(self) -> tuple[str]: ...

@final
class Instance:
    """A valid instance of task allocation, ready to be planned for. It never changes.

    R robots and T tasks. A robot is (depot, skills), a task (position, skills, duration); skills
    are numbers from 0 to 31. A schedule is a list of R lists of tasks, in the order in which the
    robot goes to them. Times have the units of durations. All methods let other threads go on.

    Raises:
        ValueError: (of `Instance(...)`) one line that names the robot or task, the value and what
            is allowed.
    """

    def __new__(
        cls,
        speed: float,
        robots: Sequence[tuple[Sequence[float], Sequence[int]]],
        tasks: Sequence[tuple[Sequence[float], Sequence[int], float]],
    ) -> Instance: ...
    def plan(
        self,
        seed: int,
        evaluations: int | None,
        seconds: float | None,
        order: Sequence[int] | None = None,
    ) -> tuple[list[list[int]], int]:
        """The best schedule of a search, and how many orders of tasks it tried.

        It begins with `order`, or with the one of `greedy`, and ends at the first limit. With
        `evaluations` alone it gives the same bits on every machine.

        Raises:
            ValueError: there is no limit, `seconds` is not 0 to 1e6, or `order` has not each task
                once.
        """

    def schedule(self, order: Sequence[int]) -> list[list[int]]:
        """The schedule of an order of all tasks.

        Raises:
            ValueError: `order` has not each task once.
        """

    def greedy(self) -> list[list[int]]:
        """The schedule in which always the task that can begin soonest comes next."""

    def random(self, seed: int) -> list[list[int]]:
        """Tasks in a random order, each with random robots."""

    def simulate(self, schedule: Sequence[Sequence[int]]) -> tuple[list[float], list[float], float]:
        """When each task begins (T), when each robot is back (R), and the makespan.

        Raises:
            ValueError: a task does not get exactly the robots that it needs, or robots wait for
                each other for ever (deadlock).
        """

@final
class Dispatcher:
    """The team and the tasks of a scenario, ready to be planned for. It never changes.

    R robots, A abilities, V victim slots. A robot is (final speed [m/s], lag of a start [s], its
    battery, its load, amounts of the A abilities); a battery (capacity [J], energy for a metre
    [J/m] and for a start [J], idle power [W]). Needs of a type of victims are (abilities, amounts):
    an ability for each robot, or A amounts that helpers have together. A station is (place [m],
    radius [m], power [W]), a depot (place [m], radius [m]). `aim` has the weights of the sum of the
    times of rescues and of the last one, and `orders` is how many orders of a world's victims are
    tried.

    Raises:
        ValueError: too many robots or abilities, or no order.
    """

    def __new__(
        cls,
        robots: Sequence[
            tuple[
                float,
                float,
                tuple[float, float, float, float] | None,
                int | None,
                Sequence[float],
            ]
        ],
        needs: Sequence[tuple[Sequence[int], Sequence[float] | None]],
        stations: Sequence[tuple[Sequence[float], float, float]],
        depots: Sequence[tuple[Sequence[float], float]],
        radius: float,
        along_axes: bool,
        aim: tuple[float, float],
        orders: int,
    ) -> Dispatcher: ...
    def choose(
        self,
        positions: NDArray[np.float64],
        charges: NDArray[np.float64],
        loads: NDArray[np.int64],
        times: NDArray[np.float64],
        numbers: NDArray[np.int64],
        victims: NDArray[np.float64],
    ) -> NDArray[np.int64]:
        """The slot to which each robot goes first in the best plan, (E, R); -1 for none.

        Args:
            positions: (E, R, 2) [m].
            charges: (E, R) [J].
            loads: (E, R) rescues that robots can still help with.
            times: (E, R, V) when robots could be at victims [s].
            numbers: (E, V, 2) type of the victim, -1 for none, and the slots of those for which it
                has to wait, as bits.
            victims: (E, V, 4) place [m], how long helpers stay [s] and time until it is lost [s].

        Raises:
            TypeError: not arrays of such numbers.
            ValueError: wrong shapes, an unknown type, or victims wait for each other in a circle.
        """

@final
class Orders:
    """B orders of the tasks of instances, made task by task. F is `ORDER_FEATURES`.

    T is the most tasks of an instance; rows of tasks that an instance does not have are 0. One
    thread at a time may use it.

    Raises:
        ValueError: (of `Orders(...)`) there are no instances.
    """

    def __new__(cls, instances: Sequence[Instance]) -> Orders: ...
    def features(self) -> NDArray[np.float32]:
        """What is known of each task that could come next (B, T, F); 0 of the others."""

    def take(self, tasks: ArrayLike) -> None:
        """Put a task at the end of each order: (B) integers, -1 where an order has all of them.

        Raises:
            TypeError: they are no integers.
            ValueError: there are not B, or one could not come next; no order is changed.
        """

    def makespans(self) -> NDArray[np.float64]:
        """When the last robot would be back if nothing came any more (B)."""

    def orders(self) -> list[list[int]]:
        """The tasks so far."""

@final
class Routes:
    """Shortest ways of a scenario's robots around the obstacles of its worlds.

    E worlds, O obstacles, R robots, each with G goals or K places. Ways are those of discs on a
    grid of cells half a robot's radius wide, of which an arena has 256 along a side at most.
    Lengths are infinite where there is no way. A robot that no obstacle blocks goes straight.
    """

    def __new__(cls, rules: Rules) -> Routes: ...
    def ways(
        self,
        obstacles: NDArray[np.float32],
        positions: NDArray[np.float32],
        goals: NDArray[np.float32],
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Lengths (E, R, G) and first turns (E, R, G, 2) of the ways to goals [m].

        Args:
            obstacles: (E, O, 2) [m].
            positions: (E, R, 2) [m].
            goals: (E, R, G, 2) [m].

        Raises:
            TypeError: not arrays of floats.
            ValueError: wrong shapes, or not numbers.
        """

    def left(
        self,
        obstacles: NDArray[np.float32],
        positions: NDArray[np.float32],
        towards: NDArray[np.float32],
        goals: NDArray[np.float32],
    ) -> NDArray[np.float32]:
        """Lengths (E, R, K) of the ways that are left after driving straight towards places [m].

        Robots drive as far as they come before an obstacle stops them.

        Args:
            obstacles: (E, O, 2) [m].
            positions: (E, R, 2) [m].
            towards: (E, R, K, 2) [m].
            goals: (E, R, 2) [m].

        Raises:
            TypeError: not arrays of floats.
            ValueError: wrong shapes, or not numbers.
        """

@final
class Batch:
    """Many rescue worlds of one scenario.

    E envs, R robots, D columns of an observation, V victim slots, O obstacles, C reward components
    (`REWARD_COMPONENTS`), K kinds of faults (`FAULT_KINDS`).

    Arrays that are given are copied before they are checked. Those returned by `step` are the
    caller's own if `give`, else read-only and valid until the step after next, as those of
    `reward_components` always are; all others are fresh. Not to be used from two threads at once
    (RuntimeError), nor, with several threads, in a child process after a fork (RuntimeError).

    `autoreset` is "same_step", "next_step" or "disabled".

    Raises:
        ValueError: num_envs, num_threads or autoreset not allowed, or more threads than the system
            gives.
        MemoryError: the arrays do not fit.
    """

    def __new__(
        cls,
        rules: Rules,
        num_envs: int,
        seed: int,
        num_threads: int | None,
        first_env: int,
        autoreset: str,
        give: bool,
    ) -> Batch: ...
    @property
    def num_threads(self) -> int:
        """Threads in use."""

    @property
    def obs_width(self) -> int:
        """Columns D of an observation."""

    def observation_names(self) -> list[str]:
        """Names of the D columns; units are m and m/s."""

    def reset(self, seed: int | None, mask: ArrayLike | None) -> NDArray[np.float32]:
        """Start new episodes in the worlds of `mask` (E,); returns observations (E, R, D)."""

    def step(
        self, actions: ArrayLike
    ) -> tuple[
        NDArray[np.float32],
        NDArray[np.float32],
        NDArray[np.bool_],
        NDArray[np.bool_],
        NDArray[np.float32],
        NDArray[np.void],
    ]:
        """Do one control step; actions are (E, R) integers, or (E, R, 2) floats when continuous.

        Returns:
            obs (E, R, D), reward (E, R), terminated (E,), truncated (E,), final_obs (E, R, D), and
            rescues (n,) structured int64: env, episode, step, slot, victim, task, helper_0, ...
            (-1 for none).

        Raises:
            TypeError: wrong dtype, a masked array, or no array.
            ValueError: wrong shape, an action out of range or not a number (env and robot are
                named), or a world that waits for a reset. Nothing has moved then.
            innerattn.errors.WorldError: worlds failed in this step; all others have done it.
        """

    def lost(self) -> NDArray[np.void]:
        """Victims lost in the last step, (n,) structured int64.

        Fields: env, episode, step, slot, victim, task.
        """

    def turned_away(self) -> NDArray[np.int64]:
        """Victims that found all slots of their task taken in the last step, (E,)."""

    def _panic_in_next_step(self, envs: Sequence[int]) -> None:
        """For tests: let these worlds fail in the next step."""

    def reward_components(self) -> NDArray[np.float32]:
        """Rewards of the last step by component, (E, R, C)."""

    def observe(self) -> NDArray[np.float32]:
        """Present observations, (E, R, D)."""

    def headings(self) -> NDArray[np.float32]:
        """Angles from the x axis, counterclockwise, (E, R) [rad]; 0 of robots without a heading."""

    def turn_rates(self) -> NDArray[np.float32]:
        """Turn rates in the last step, counterclockwise, (E, R) [rad/s]; 0 without a heading."""

    def charge(self) -> NDArray[np.float32]:
        """Charges of the robots as shares of their battery's capacity, (E, R)."""

    def can_act(self) -> NDArray[np.bool_]:
        """Whether commands move the robots now, (E, R)."""

    def load(self) -> NDArray[np.float32]:
        """Loads of the robots as shares of their full load, (E, R)."""

    def last_seen(self) -> NDArray[np.int64]:
        """Steps at which robots last saw robots and victims, (E, R, R + V); -1: never."""

    def heard(self) -> NDArray[np.bool_]:
        """Whether robot i hears robot j now, (E, R, R)."""

    def positions(self) -> NDArray[np.float32]:
        """Places of the robots, (E, R, 2), m."""

    def velocities(self) -> NDArray[np.float32]:
        """Velocities of the robots, (E, R, 2), m/s."""

    def obstacles(self) -> NDArray[np.float32]:
        """Centres of the obstacles, (E, O, 2), m."""

    def victims(self) -> tuple[NDArray[np.int64], NDArray[np.float32]]:
        """Victims as (E, V, 4) present, task, id, appeared_step and (E, V, 2) places, m."""

    def step_counts(self) -> NDArray[np.int64]:
        """Steps done in each env's episode, (E,)."""

    def episodes(self) -> NDArray[np.int64]:
        """Each env's episode, from 0, (E,)."""

    def set_motion(self, positions: ArrayLike, velocities: ArrayLike) -> None:
        """Put the robots at positions (E, R, 2), m, with velocities (E, R, 2), m/s."""

    def set_headings(self, headings: ArrayLike) -> None:
        """Let robots on wheels point along angles (E, R) [rad] from -pi to pi, without turning.

        Raises:
            TypeError: not an array of numbers.
            ValueError: no robot has a heading, wrong shape, or an angle out of range (env and robot
                are named).
        """

    def set_victims(self, present: ArrayLike, tasks: ArrayLike, places: ArrayLike) -> None:
        """Move victims, and let new ones appear in empty slots.

        Args:
            present: (E, V) bool; true for a slot that has or gets a victim.
            tasks: (E, V) integers.
            places: (E, V, 2), m.

        Raises:
            ValueError: wrong shape, a victim that is taken away, or a task or a place that no
                victim of the slot can have (field, env and slot are named). Nothing has changed
                then.
        """

    def fault_state(self) -> NDArray[np.float32]:
        """Levels of the faults in effect, (E, R, K)."""

    def set_faults(self, levels: ArrayLike, mask: ArrayLike | None) -> None:
        """Put levels (E, R, K) in place of the scenario's faults in the worlds of `mask` (E,).

        Raises:
            ValueError: wrong shape, or a level out of range (kind, env and robot are named).
                Nothing has changed then.
        """

    def snapshot(self) -> bytes:
        """Image of all worlds, with a checksum."""

    def restore(self, image: bytes) -> None:
        """Put all worlds back into an image's state; ValueError, and no change, if refused."""
