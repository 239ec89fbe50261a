"""One world that a policy acts in, step by step, while somebody changes it; it shows nothing."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from innerattn import _core
from innerattn.config import Scenario
from innerattn.config.streams import stream_seed
from innerattn.envs import BatchEnv
from innerattn.envs.senses import ray_columns
from innerattn.evaluate.moment import Handoff, Loss, Moment, Rescue
from innerattn.evaluate.play import Attentive
from innerattn.measures.moments import blocked_between
from innerattn.policies import Policy, PolicyInput, WorldState
from innerattn.policies.policy import pointing

LONGEST_EPISODE = 1_000_000
"""Control steps after which an endless world begins its next episode: a day at 0.1 s."""

MOST_PUSH_MPS = 5.0
"""Fastest velocity on an axis that a push may give."""

HEALTHY = {name: healthy for name, _, _, _, healthy, _ in _core.FAULT_KINDS}
"""The value of each kind of fault that means that nothing is wrong."""


def endless(scenario: Scenario) -> Scenario:
    """The same world, in which an episode goes on until somebody begins another one."""
    return scenario.replace(
        episode_steps=LONGEST_EPISODE, end_when_rescued=None, end_when_done=False
    )


class InteractiveWorld:
    """One world, several policies that may drive it, and hands that reach into it.

    Every change is checked before it is made: a `ValueError` says what is wrong, and then nothing
    has changed. The actions of the next step are chosen once for each state, so that what is shown
    as attention belongs to what the robots do next.
    """

    def __init__(
        self,
        scenario: Scenario,
        policies: Mapping[str, Policy],
        seed: int = 0,
        num_own: int | None = None,
    ) -> None:
        """Begin episode 0.

        Args:
            scenario: the world.
            policies: by the name to show; the first one acts.
            seed: of the world and of what policies draw, 0 to 2**63 - 1.
            num_own: how many robots are the team, the first ones; the others are spare ones of
                `innerattn.evaluate.spares`. None: all are the team.

        Raises:
            ValueError: there is no policy, or the seed is out of range.
        """
        if not policies:
            raise ValueError("policies is empty: must hold at least one")
        self.scenario = scenario
        self.num_own = scenario.num_robots if num_own is None else num_own
        self.policies = dict(policies)
        self._seed = stream_seed(seed, "evaluation")
        self._env = BatchEnv(scenario, 1, self._seed, num_threads=1)
        self._rays = ray_columns(self._env)
        self._policy = next(iter(self.policies))
        self._steered: int | None = None
        self._drive = (0.0, 0.0)
        self._begin(self._env.reset())

    def close(self) -> None:
        """Free the world."""
        self._env.close()

    def moment(self) -> Moment:
        """The world now."""
        env = self._env
        return Moment(
            episode=int(env.episodes()[0]),
            step=int(env.step_counts()[0]),
            policy=self._policy,
            steered=self._steered,
            positions=env.positions()[0],
            velocities=env.velocities()[0],
            victims=env.victims()[0],
            faults=env.fault_state()[0],
            headings=None if (headings := pointing(env)) is None else headings[0],
            charge=env.charge()[0] if env.scenario.has_batteries else None,
            load=env.load()[0] if env.scenario.has_loads else None,
            heard=env.heard()[0] if env.scenario.limits_communication else None,
            rays=self._obs[0][:, self._rays] if self._rays else None,
            obstacles=env.obstacles()[0],
            blocked=self._blocked,
            attention=self._attention,
            rescues=self._rescues,
            lost=self._lost,
            handoffs=self._handoffs,
            rescued=self._rescued,
            helped=tuple(self._helped),
        )

    def step(self) -> None:
        """Do one control step."""
        env = self._env
        before, velocities, faults = env.positions(), env.velocities(), env.fault_state()
        headings = pointing(env)
        step = env.step(self._actions)
        if step.truncated[0] or step.terminated[0]:
            self._begin(step.obs)
            return
        self._obs = step.obs
        self._blocked = blocked_between(
            self.scenario,
            before,
            env.positions(),
            velocities,
            self._actions,
            faults,
            env.obstacles(),
            headings,
        )[0]
        self._note(step.rescues)
        self._note_lost(env.lost())
        self._choose()

    def restart(self, seed: int | None = None) -> None:
        """Begin an episode, without the faults that somebody has set.

        Args:
            seed: of the world and of what policies draw: it begins their episode 0; None: the next
                episode.
        """
        if seed is None:
            self._begin(self._env.reset())
            return
        self._seed = stream_seed(seed, "evaluation")
        self._begin(self._env.reset(self._seed))

    def choose_policy(self, name: str) -> None:
        """Let another policy act, from the present state on.

        Raises:
            ValueError: there is no such policy.
        """
        if name not in self.policies:
            raise ValueError(f"policy = {name!r}: must be one of {', '.join(self.policies)}")
        self._policy = name
        self._reset_policy()
        self._choose()

    def steer(self, robot: int | None, drive: tuple[float, float] = (0.0, 0.0)) -> None:
        """Drive one robot by hand from now on, or none.

        Args:
            robot: its index; none: the policy drives all.
            drive: x and y, -1 to 1; on wheels y is ahead and -x to the left, as seen on the way.
                Where actions are discrete, the larger one counts.
        """
        steered = None if robot is None else self._robot(robot)
        for axis, share in zip("xy", drive, strict=True):
            _within(f"drive {axis}", share, 1.0, "")
        self._steered, self._drive = steered, drive
        self._choose()

    def move_robot(self, robot: int, x: float, y: float) -> None:
        """Put a robot somewhere else, at rest; x and y [m], its disc inside the arena."""
        radius = self.scenario.robots[self._robot(robot)].radius_m
        most = self.scenario.arena_half_width_m - radius
        _within("x", x, most, " m")
        _within("y", y, most, " m")
        positions, velocities = self._env.positions(), self._env.velocities()
        positions[0, robot], velocities[0, robot] = (x, y), 0.0
        self._env.set_motion(positions, velocities)
        self._changed()

    def push_robot(self, robot: int, vx: float, vy: float) -> None:
        """Give a robot another velocity [m/s], at most `MOST_PUSH_MPS` on each axis."""
        _within("vx", vx, MOST_PUSH_MPS, " m/s")
        _within("vy", vy, MOST_PUSH_MPS, " m/s")
        velocities = self._env.velocities()
        velocities[0, self._robot(robot)] = (vx, vy)
        self._env.set_motion(self._env.positions(), velocities)
        self._changed()

    def set_faults(self, robot: int, values: Mapping[str, float]) -> None:
        """Set some kinds of faults of a robot, until the episode ends.

        Args:
            robot: its index.
            values: by kind, in the kind's unit; `HEALTHY` has the values of a healthy robot.
        """
        faults = self._env.fault_state()
        for kind, value in values.items():
            if kind not in HEALTHY:
                raise ValueError(f"fault {kind!r}: must be one of {', '.join(HEALTHY)}")
            faults[kind][0, self._robot(robot)] = value
        self._env.set_faults(faults)
        self._changed()

    def add_robot(self, kind: str) -> None:
        """Let a spare robot of a kind into the arena, at a random free place and with no fault.

        It is there until somebody makes it unavailable, or the episode ends.

        Raises:
            ValueError: there is no such kind, or all spare robots of the kind are in the arena.
        """
        spares = range(self.num_own, self.scenario.num_robots)
        of_kind = [robot for robot in spares if self.scenario.robots[robot].kind == kind]
        if not of_kind:
            kinds = ", ".join(dict.fromkeys(self.scenario.robots[one].kind for one in spares))
            known = f"must be one of {kinds}" if kinds else "no robot can be added to this world"
            raise ValueError(f"kind = {kind!r}: {known}")
        faults = self._env.fault_state()
        robot = next((one for one in of_kind if faults["unavailable"][0, one] >= 1.0), None)
        if robot is None:
            raise ValueError(
                f"all {len(of_kind)} spare {kind} robots are in the arena: take one out first"
            )
        for fault, healthy in HEALTHY.items():
            faults[fault][0, robot] = healthy
        self._env.set_faults(faults)
        self._changed()

    def move_victim(self, slot: int, x: float, y: float) -> None:
        """Move the victim of a slot; x and y [m]."""
        victims = self._env.victims()
        if not 0 <= slot < len(victims[0]) or not victims["present"][0, slot]:
            raise ValueError(f"slot = {slot}: holds no victim")
        victims["x"][0, slot], victims["y"][0, slot] = x, y
        self._env.set_victims(victims)
        self._changed()

    def add_victim(self, task: int, x: float, y: float) -> None:
        """Let a victim of a task appear in an empty slot; x and y [m]."""
        victims = self._env.victims()
        slots = self.scenario.slots_of(task)
        slot = next((slot for slot in slots if not victims["present"][0, slot]), None)
        if slot is None:
            raise ValueError(
                f"all {len(slots)} places for victims are taken in this world: move a victim, "
                "or wait for a rescue"
            )
        victims["present"][0, slot], victims["task"][0, slot] = True, task
        victims["x"][0, slot], victims["y"][0, slot] = x, y
        self._env.set_victims(victims)
        self._changed()

    def _begin(self, obs: NDArray[np.float32]) -> None:
        """Forget the episode before."""
        robots = self.scenario.num_robots
        self._obs = obs
        self._rescued, self._helped = 0, [0] * robots
        self._last: dict[int, Rescue] = {}
        self._nothing_happened()
        self._reset_policy()
        self._choose()

    def _reset_policy(self) -> None:
        episode = int(self._env.episodes()[0])
        seed = np.random.SeedSequence((self._seed, episode)).generate_state(1)[0]
        self.policies[self._policy].reset(int(seed))

    def _changed(self) -> None:
        self._obs = self._env.observe()
        self._nothing_happened()
        self._choose()

    def _nothing_happened(self) -> None:
        self._blocked = np.zeros(self.scenario.num_robots, np.bool_)
        self._rescues: tuple[Rescue, ...] = ()
        self._lost: tuple[Loss, ...] = ()
        self._handoffs: tuple[Handoff, ...] = ()

    def _choose(self) -> None:
        """Choose the actions of the next step, and ask for the attention that goes with them."""
        policy = self.policies[self._policy]
        state = WorldState.of(self._env) if policy.needs_true_state else None
        view = PolicyInput(self._obs, state)
        actions = np.array(policy.act(view))
        if self._steered is not None:
            actions[0, self._steered] = self._steered_action()
        self._actions: NDArray[Any] = actions
        weights = None
        if isinstance(policy, Attentive) and self.scenario.num_robots > 1:
            weights = policy.attention(view, actions)
        self._attention = None if weights is None else weights[0]

    def _steered_action(self) -> Any:
        x, y = self._drive
        robot = self.scenario.robots[self._steered or 0]
        if robot.has_wheels:
            x, y = y, -x
        if self.scenario.actions == "continuous":
            if robot.drive == "differential":
                x, y = max(-1.0, min(1.0, x - y)), max(-1.0, min(1.0, x + y))
            return np.array((x, y), np.float32)
        if x == y == 0.0:
            return 0
        return (1 if x > 0 else 2) if abs(x) >= abs(y) else (3 if y > 0 else 4)

    def _note(self, events: NDArray[np.void]) -> None:
        """Count the rescues of a step, and find the handoffs that they complete."""
        names = [name for name in events.dtype.names or () if name.startswith("helper_")]
        rescues, found = [], []
        for event in events:
            helpers = tuple(int(event[name]) for name in names if event[name] >= 0)
            step, victim, task = (int(event[name]) for name in ("step", "victim", "task"))
            rescue = Rescue(step, victim, task, helpers)
            rescues.append(rescue)
            for robot in helpers:
                self._helped[robot] += 1
                found += self._handed_over(robot, rescue)
                self._last[robot] = rescue
        self._rescued += len(rescues)
        self._rescues, self._handoffs = tuple(rescues), tuple(found)

    def _note_lost(self, events: NDArray[np.void]) -> None:
        """Keep who was lost in a step."""
        self._lost = tuple(Loss(*(int(event[name]) for name in Loss._fields)) for event in events)

    def _handed_over(self, robot: int, now: Rescue) -> list[Handoff]:
        """The handoff that a rescue completes for a robot, as `measures.sharing.handoff` has it."""
        last = self._last.get(robot)
        if last is None or last.task == now.task:
            return []
        tasks = self.scenario.tasks
        if any(len(tasks[one.task].roles) != 2 for one in (last, now)):
            return []
        before, after = (
            next(other for other in one.helpers if other != robot) for one in (last, now)
        )
        return [] if before == after else [Handoff(robot, before, after, last.step, now.step)]

    def _robot(self, robot: int) -> int:
        robots = self.scenario.num_robots
        if not 0 <= robot < robots:
            raise ValueError(f"robot = {robot}: must be in 0..={robots - 1}")
        return robot


def _within(name: str, value: float, most: float, unit: str) -> None:
    if not -most <= value <= most:
        raise ValueError(f"{name} = {value}: must be in {-most:g}..={most:g}{unit}")
