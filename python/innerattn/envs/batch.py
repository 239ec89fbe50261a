"""`BatchEnv`: many rescue worlds stepped together over numpy arrays. It knows no rule of theirs."""

from __future__ import annotations

from functools import cached_property
from types import TracebackType
from typing import Any, Literal, NamedTuple, Self, TypeVar, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from innerattn import _core
from innerattn.config.scenario import Scenario
from innerattn.envs.entities import Entities, EntityLayout
from innerattn.envs.state import state_names, world_states
from innerattn.envs.victims import victim_columns, victim_table
from innerattn.shown import Shown

Autoreset = Literal["same_step", "next_step", "disabled"]
Array = TypeVar("Array", bound=NDArray[Any])

NUM_DISCRETE_ACTIONS = 5
MOST_SEED = 2**64 - 1
FAULT_KINDS: tuple[str, ...] = tuple(name for name, *_ in _core.FAULT_KINDS)
"""Kinds of faults; `BatchEnv.fault_state` has a field for each."""
_FAULT_DTYPE = np.dtype([(kind, "f4") for kind in FAULT_KINDS])


class Step(NamedTuple):
    """What one control step of E worlds with R robots gave."""

    obs: NDArray[np.float32]
    """(E, R, D): observations now; of the next episode where one ended (autoreset)."""
    reward: NDArray[np.float32]
    """(E, R): sum of the reward components."""
    terminated: NDArray[np.bool_]
    """(E,): the scenario's goal ended the episode."""
    truncated: NDArray[np.bool_]
    """(E,): time ended the episode."""
    final_obs: NDArray[np.float32]
    """(E, R, D): observations after the step and before any autoreset, for every env."""
    rescues: NDArray[np.void]
    """(n,) structured int64: env, episode, step, slot, victim, task, helper_0, ... (-1 = none)."""


class BatchEnv(Shown):
    """E rescue worlds of one scenario, stepped together by compiled code on several threads.

    Autoreset is Gymnasium's SAME_STEP: on an episode's last step `obs` is the next episode's
    first already and `final_obs` holds the last of the old one. With "next_step" (Gymnasium's
    NEXT_STEP) the step after the last one begins the next episode and does nothing else in that
    world: its action is not used, its rewards are 0. A step gives arrays of your own,
    as `reset` and `observe` do; memory that no array leads to any more is used for later steps.
    With `copy=False` it lends C-contiguous read-only views of buffers
    owned by the environment. They are valid until the step after next, which gives the same array
    objects again: change neither their shape nor their dtype in place, and let no thread read them
    while another steps. Such a batch takes no new memory, whatever you keep.

    A step that takes long looks for Ctrl-C on the way; if that raises, nothing has moved. Worlds
    that fail inside compiled code are named by a `WorldError`; all others have done the step.

    A batch can be pickled and deep-copied, to other processes, too: its copy goes on from the same
    state. The rewards of the last step by component are not part of that.

    World i depends on scenario, seed, `first_env + i` and its actions alone, whatever the number of
    threads or worlds. The scenario was checked when it was made; what it does not say (sizes, seed,
    memory) is checked here.

    Args:
        scenario: a `Scenario` or the name of a preset.
        num_envs: number of worlds E, 1 to 1,048,576.
        seed: seed of all random streams, 0 to 2**64 - 1.
        num_threads: 1 to 256; as many cores as are worth it if None.
        autoreset: "same_step", "next_step", or "disabled" to leave ended worlds until
            `reset(mask=...)`.
        copy: let steps return arrays of your own; views if False.
        first_env: number of the first world's random streams, for batches split over processes.

    Raises:
        ConfigError: unknown preset.
        TypeError: a value of another type.
        ValueError: a value that is not allowed, named with its range.
        MemoryError: the arrays do not fit.
    """

    reward_component_names: tuple[str, ...] = tuple(name for name, _ in _core.REWARD_COMPONENTS)
    """Names of the C reward components."""

    def __init__(
        self,
        scenario: Scenario | str,
        num_envs: int,
        seed: int = 0,
        num_threads: int | None = None,
        *,
        autoreset: Autoreset = "same_step",
        copy: bool = True,
        first_env: int = 0,
    ) -> None:
        if not isinstance(scenario, (Scenario, str)):
            raise TypeError(
                f"scenario = {scenario!r}: must be a Scenario or the name of a preset; "
                "Scenario.from_toml reads a file"
            )
        self.scenario = Scenario.preset(scenario) if isinstance(scenario, str) else scenario
        if not isinstance(copy, bool):
            raise TypeError(f"copy = {copy!r}: must be True or False")
        if autoreset not in get_args(Autoreset):
            known = "'same_step', 'next_step' or 'disabled'"
            raise ValueError(f"autoreset = {autoreset!r}: must be {known}")
        self._batch: _core.Batch | None = _core.Batch(
            self.scenario.rules,
            whole_number("num_envs", num_envs, 1, 2**20),
            whole_number("seed", seed, 0, MOST_SEED),
            None if num_threads is None else whole_number("num_threads", num_threads, 1, 256),
            whole_number("first_env", first_env, 0, 2**63),
            autoreset,
            copy,
        )
        self._made_with = (seed, num_threads, autoreset, copy, first_env)
        self.num_envs = int(num_envs)
        self.num_threads = self._core.num_threads
        self.robot_names = tuple(robot.name for robot in self.scenario.robots)
        self.num_robots = len(self.robot_names)
        self.continuous = self.scenario.actions == "continuous"
        self.num_actions = 0 if self.continuous else NUM_DISCRETE_ACTIONS
        self.obs_width = self._core.obs_width
        self._copy = copy

    def reset(self, seed: int | None = None, mask: ArrayLike | None = None) -> NDArray[np.float32]:
        """Start new episodes.

        Args:
            seed: restart from episode 0 under this seed; None goes on to each world's next episode
                (the first reset keeps episode 0, if no step was done before).
            mask: (E,) bool, the worlds to reset; all if None.

        Returns:
            Observations of all worlds, (E, R, D) float32.

        Raises:
            TypeError, ValueError: a seed or mask that is not allowed; nothing has changed then.
        """
        if seed is not None:
            seed = whole_number("seed", seed, 0, MOST_SEED)
        return self._core.reset(seed, mask)

    def step(self, actions: ArrayLike) -> Step:
        """Do one control step in every world.

        Args:
            actions: (E, R) integers (0 stay, 1 +x, 2 -x, 3 +y, 4 -y; on wheels 0 stop, 1 forward,
                2 backward, 3 turn left, 4 turn right), or (E, R, 2) floats in [-1, 1] when the
                scenario's actions are continuous.

        The actions are copied before they are checked: no other thread can change them on the way.

        Raises:
            TypeError: wrong dtype, a masked array, or no array at all.
            ValueError: wrong shape, an action out of range or not a number (env and robot are
                named), or a world that waits for a reset: its episode is over (autoreset
                disabled), or it failed. Nothing has moved then.
            WorldError: worlds failed in this step; `envs` names them. All others have done it.
            KeyboardInterrupt: Ctrl-C during a long step; nothing has moved.
        """
        return Step._make(self._core.step(actions))

    def observation_names(self) -> list[str]:
        """Names of the D columns of an observation; units are m, m/s and rad/s."""
        return self._core.observation_names()

    def observe(self) -> NDArray[np.float32]:
        """Present observations, (E, R, D) float32 (after `restore`, say)."""
        return self._core.observe()

    @cached_property
    def entity_layout(self) -> EntityLayout:
        """Which columns of an observation tell of the robot itself, of teammates and of victims."""
        return EntityLayout.of(self.observation_names())

    def entities(self, obs: NDArray[np.float32] | None = None) -> Entities:
        """What each robot sees, by entity: tables with leading dimensions (E, R), and masks.

        Args:
            obs: (E, R, D) observations, such as those of a step; None: the present ones. Tables
                are views of them.
        """
        return self.entity_layout.entities(self.observe() if obs is None else obs)

    def reward_components(self) -> NDArray[np.float32]:
        """Rewards of the last step, (E, R, C) float32, columns `reward_component_names`."""
        return self._lend(self._core.reward_components())

    def positions(self) -> NDArray[np.float32]:
        """Places of the robots, (E, R, 2) float32, m, world frame."""
        return self._core.positions()

    def velocities(self) -> NDArray[np.float32]:
        """Velocities of the robots, (E, R, 2) float32, m/s, world frame."""
        return self._core.velocities()

    def headings(self) -> NDArray[np.float32]:
        """Where robots on wheels point, (E, R) float32, rad, -pi to pi.

        An angle from the x axis, counterclockwise; 0 for a robot without a heading.
        """
        return self._core.headings()

    def turn_rates(self) -> NDArray[np.float32]:
        """How fast robots turned in the last step, (E, R) float32, rad/s, counterclockwise.

        It is 0 for a robot without a heading.
        """
        return self._core.turn_rates()

    def charge(self) -> NDArray[np.float32]:
        """Charges of the robots, (E, R) float32, shares of their battery's capacity.

        It is 1 for a robot without a battery. At 0 a robot neither drives nor helps.
        """
        return self._core.charge()

    def load(self) -> NDArray[np.float32]:
        """Loads of the robots, (E, R) float32, shares of their full load.

        It is 1 for a robot without a load. At 0 a robot drives, but does not help.
        """
        return self._core.load()

    def last_seen(self) -> NDArray[np.int64]:
        """Steps of the episode at which each robot last saw each robot and each slot's victim.

        (E, R, R + V) int64, -1 for what it never saw in this episode, as itself. A robot sees
        something now where this is `step_counts`. Where no sight is limited, it is so everywhere.
        Where robots share victims, what a robot was told counts as seen when the teller saw it.
        """
        return self._core.last_seen()

    def heard(self) -> NDArray[np.bool_]:
        """Who hears whom now, (E, R, R) bool: robot i hears what robot j sent.

        The diagonal is False. Nobody hears a robot that was not in the arena when it sent. A robot
        hears nobody while it is not in the arena, in a blackout and while its communication is
        lost. Where nothing limits communication, each robot hears all others.
        """
        return self._core.heard()

    def obstacles(self) -> NDArray[np.float32]:
        """Centres of the obstacles in scenario order, (E, O, 2) float32, m."""
        return self._core.obstacles()

    def victims(self) -> NDArray[np.void]:
        """Victims by slot, (E, V) structured: present, task, id, appeared_step, x, y (m).

        Where the scenario has services also ``served``, the share of its service that a victim has
        had; where it has deadlines ``deadline_step``, the steps done in the episode when it is lost
        (-1: never); and where its tasks have an order ``blocked``, whether it has to wait for
        others. A slot without a victim has 0 and -1.
        """
        return victim_table(*self._core.victims(), self.scenario)

    def lost(self) -> NDArray[np.void]:
        """Victims lost in the last step, (n,) structured int64.

        Fields: env, episode, step, slot, victim, task, as those of `Step.rescues`.
        """
        return self._core.lost()

    def turned_away(self) -> NDArray[np.int64]:
        """Victims that found all slots of their task taken in the last step, (E,) int64.

        They never appear. There are none but where victims arrive whatever becomes of others.
        """
        return self._core.turned_away()

    def step_counts(self) -> NDArray[np.int64]:
        """Steps done in each world's episode, (E,) int64."""
        return self._core.step_counts()

    def episodes(self) -> NDArray[np.int64]:
        """Each world's episode, from 0, (E,) int64."""
        return self._core.episodes()

    def fault_state(self) -> NDArray[np.void]:
        """What is wrong with each robot now, (E, R) structured float32, a field for each kind.

        motor_gain and speed_limit are shares of the healthy value (1 = healthy), heading_bias an
        angle [rad], position_noise [m] and velocity_noise [m/s] standard deviations on each axis,
        frozen_sensor, blackout, unavailable and lost_communication shares of the control steps
        that are struck (0 = healthy, 1 = all).
        """
        return self._core.fault_state().view(_FAULT_DTYPE)[..., 0]

    def state(self) -> NDArray[np.float32]:
        """The whole of each world, (E, S) float32, world frame, for centralised critics.

        Columns are `state_names`: for each robot x, y [m] and x, y velocity [m/s], where some robot
        has a heading its x, y (of length 1; zeros of others) and turn rate [rad/s], and its charge
        and load as shares where some robots have a battery and a load; for each victim
        slot one column per task (1 where such a victim is present), x, y [m], and where the
        scenario has them the share of its service that it has had, the time that it has left as a
        share of the longest deadline, and 1 if it has to wait for others; for each obstacle x, y
        [m]. Empty slots are zeros.
        """
        return world_states(
            self.positions(),
            self.velocities(),
            self.victims(),
            self.obstacles(),
            self.step_counts(),
            self.scenario,
            self.charge(),
            self.load(),
            self.headings(),
            self.turn_rates(),
        )

    def state_names(self) -> list[str]:
        """Names of the S columns of `state`; units are m and m/s."""
        return state_names(self.scenario)

    def set_faults(self, faults: NDArray[np.void], mask: ArrayLike | None = None) -> None:
        """Put faults in place of the scenario's, from now to the end of the present episodes.

        Args:
            faults: (E, R) structured with the fields of `fault_state`: take that array, change what
                is to change, and give it back.
            mask: (E,) bool, the worlds to change; all if None.

        Raises:
            TypeError: other fields, fields that are no numbers, a masked array, or a mask that is
                not bool.
            ValueError: wrong shape, or a value out of range or not a number in a world of the mask
                (kind, env and robot are named). Nothing has changed then.
        """
        wanted = f"must have shape ({self.num_envs}, {self.num_robots}) and a number in each field"
        if isinstance(faults, np.ma.MaskedArray):
            raise TypeError(f"faults is a masked array, whose mask would be lost: it {wanted}")
        if not isinstance(faults, np.ndarray) or faults.dtype.names != FAULT_KINDS:
            found = f"has dtype {faults.dtype}" if isinstance(faults, np.ndarray) else "is no array"
            raise TypeError(f"faults {found}: must have the fields {', '.join(FAULT_KINDS)}")
        if faults.shape != (self.num_envs, self.num_robots):
            raise ValueError(f"faults has shape {faults.shape}: {wanted}")
        levels = np.empty((*faults.shape, len(FAULT_KINDS)))
        for column, kind in enumerate(FAULT_KINDS):
            field = np.asarray(faults[kind])
            if field.dtype.kind not in "iuf" or field.dtype.itemsize > 8 or field.ndim != 2:
                raise TypeError(f"faults[{kind!r}] has dtype {faults.dtype[kind]}: {wanted}")
            levels[..., column] = field
        self._core.set_faults(levels, mask)

    def present(self) -> NDArray[np.bool_]:
        """Which robots are in the arena, (E, R) bool.

        All are, but for unavailable ones where the scenario's `unavailable_robots` is "leave".
        """
        if not self.scenario.robots_leave:
            return np.ones((self.num_envs, self.num_robots), np.bool_)
        return np.asarray(self.fault_state()["unavailable"] < 1.0)

    def can_act(self) -> NDArray[np.bool_]:
        """Whether what each robot is told in the next step has an effect, (E, R) bool.

        It has none on robots that are unavailable, and on those whose battery is empty.
        """
        return self._core.can_act()

    def action_mask(self) -> NDArray[np.bool_]:
        """Which discrete actions have an effect in the next step, (E, R, A) bool.

        A robot that cannot act can only stay, which is action 0. See `can_act`.
        """
        mask = np.repeat(self.can_act()[..., None], NUM_DISCRETE_ACTIONS, axis=2)
        mask[..., 0] = True
        return mask

    def set_present(self, present: ArrayLike, mask: ArrayLike | None = None) -> None:
        """Let robots leave the arena and come back, from now to the end of the present episodes.

        A robot that comes back appears at a random place, clear of robots and obstacles. What
        else is wrong with robots stays as it is now; the scenario's faults neither come nor go any
        more in these episodes, as after `set_faults`.

        Args:
            present: (E, R) bool, who is to be in the arena.
            mask: (E,) bool, the worlds to change; all if None.

        Raises:
            TypeError: ``present`` or ``mask`` is not bool.
            ValueError: wrong shape, or the scenario's `unavailable_robots` is not "leave". Nothing
                has changed then.
        """
        if not self.scenario.robots_leave:
            raise ValueError(
                "scenario.unavailable_robots = 'stay': must be 'leave' for robots to leave"
            )
        wanted, shape = np.asarray(present), (self.num_envs, self.num_robots)
        if wanted.dtype != np.bool_:
            raise TypeError(f"present has dtype {wanted.dtype}: must be bool")
        if wanted.shape != shape:
            raise ValueError(f"present has shape {wanted.shape}: must be {shape}")
        faults = self.fault_state()
        faults["unavailable"] = ~wanted
        self.set_faults(faults, mask)

    def set_motion(self, positions: ArrayLike, velocities: ArrayLike) -> None:
        """Put the robots somewhere else, for studies of motion; rules and victims are left alone.

        Robots on wheels keep their headings, and turn no more.

        Args:
            positions: (E, R, 2) integers or floats, m, inside the arena.
            velocities: (E, R, 2) integers or floats, m/s, at most 10,000 on each axis.

        Raises:
            TypeError: wrong dtype, a masked array, or no array at all.
            ValueError: wrong shape, or a number out of range (env and robot are named). Nothing has
                changed then.
        """
        self._core.set_motion(positions, velocities)

    def set_headings(self, headings: ArrayLike) -> None:
        """Let robots on wheels point elsewhere, without turning; places and velocities stay.

        Args:
            headings: (E, R) integers or floats, rad, -pi to pi. What is given for a robot without a
                heading is not used.

        Raises:
            TypeError: wrong dtype, a masked array, or no array at all.
            ValueError: no robot has a heading, wrong shape, or an angle out of range (env and robot
                are named). Nothing has changed then.
        """
        self._core.set_headings(headings)

    def set_victims(self, victims: NDArray[np.void]) -> None:
        """Move victims, change their tasks, and let new ones appear in empty slots.

        A victim that is present stays until it is rescued or lost; it keeps its id, the step at
        which it appeared, and its service as long as it keeps its task. A new one gets the next id.
        Obstacles and robots are not looked at.

        Args:
            victims: (E, V) structured with the fields of `victims`: take that array, change what is
                to change, and give it back. ``present``, ``task``, ``x`` and ``y`` [m] are used.

        Raises:
            TypeError: other fields or dtypes, or a masked array.
            ValueError: wrong shape, a victim that is taken away, a task that the slot cannot have,
                or a place outside the arena or nearer to a wall than `wall_clearance_m` (field, env
                and slot are named). Nothing has changed then.
        """
        self._core.set_victims(*victim_columns(victims, self.num_envs, self.scenario))

    def snapshot(self) -> bytes:
        """Image of all worlds, with a checksum; `restore` continues from it bit for bit."""
        return self._core.snapshot()

    def restore(self, image: bytes) -> None:
        """Put all worlds back into an image's state, made by any batch of this size and scenario.

        Raises:
            TypeError: no bytes.
            ValueError: truncated, altered, forged or foreign bytes; nothing has changed then.
        """
        self._core.restore(image)

    def close(self) -> None:
        """Give back memory and threads; the environment cannot be used afterwards."""
        self._batch = None

    def __reduce__(self) -> tuple[Any, ...]:
        """For pickle and `copy.deepcopy`: how the batch was made, and its snapshot."""
        return _made_again, (self.scenario, self.num_envs, *self._made_with, self.snapshot())

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    @property
    def _core(self) -> _core.Batch:
        if self._batch is None:
            raise RuntimeError("this environment is closed")
        return self._batch

    def _lend(self, array: Array) -> Array:
        return array.copy() if self._copy else array


def _made_again(
    scenario: Scenario,
    num_envs: int,
    seed: int,
    num_threads: int | None,
    autoreset: Autoreset,
    copy: bool,
    first_env: int,
    image: bytes,
) -> BatchEnv:
    """The batch that was pickled."""
    env = BatchEnv(
        scenario,
        num_envs,
        seed,
        num_threads,
        autoreset=autoreset,
        copy=copy,
        first_env=first_env,
    )
    env.restore(image)
    return env


def whole_number(name: str, value: int, low: int, high: int) -> int:
    """The value as an int.

    Raises:
        TypeError: it is no integer.
        ValueError: it is not in low..=high.
    """
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)):
        raise TypeError(f"{name} = {value!r}: must be an integer in {low}..={high}")
    if not low <= value <= high:
        raise ValueError(f"{name} = {value}: must be in {low}..={high}")
    return int(value)
