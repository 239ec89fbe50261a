"""One rescue world behind PettingZoo's parallel interface, for tools that speak it.

It steps a single world through `BatchEnv`; for training at speed use `BatchEnv` itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar, TypeAlias

import numpy as np
from gymnasium import spaces
from gymnasium.error import ResetNeeded
from numpy.typing import NDArray
from pettingzoo import ParallelEnv

from innerattn.config.scenario import Scenario
from innerattn.envs.batch import BatchEnv
from innerattn.envs.spaces import robot_action_spaces, robot_observation_spaces, state_space
from innerattn.envs.view import (
    STEPS_PER_SECOND,
    Screen,
    chosen_scenario,
    seed_or_random,
    usable_modes,
)

Obs: TypeAlias = NDArray[np.float32]
Action: TypeAlias = Any  # an integer, or (2,) float32 where actions are continuous
Info: TypeAlias = dict[str, Any]

_MODES = ["human", "rgb_array"]


def parallel_env(
    scenario: Scenario | str = "mixed",
    max_cycles: int | None = None,
    render_mode: str | None = None,
    seed: int | None = None,
    **overrides: Any,
) -> RescueParallelEnv:
    """A rescue world as a PettingZoo `ParallelEnv`.

    Args:
        scenario: the world, or the name of a preset.
        max_cycles: length of an episode [control steps]; none: the scenario's `episode_steps`,
            25 in every preset.
        render_mode: none; "rgb_array": `render` gives pictures; "human": a window shows every step.
        seed: seed of the episodes until `reset` is given one; none: a random one.
        overrides: fields of `Scenario` to change.

    Raises:
        ConfigError: unknown preset, field or render mode, or an invalid value.
        TypeError: ``scenario`` or ``seed`` is of another type.
        ValueError: ``seed`` is out of range.
    """
    scenario = chosen_scenario(scenario, max_cycles, "max_cycles", overrides)
    return RescueParallelEnv(scenario, render_mode, seed)


class RescueParallelEnv(ParallelEnv[str, Obs, Action]):  # type: ignore[misc]
    """One rescue world; made by `parallel_env`.

    Agents are the robots' names. All of them live until the episode ends, by truncation after
    `episode_steps` or by termination where the scenario asks for it, and leave together. Where the
    scenario's `unavailable_robots` is "leave", `agents` holds the robots in the arena alone: one
    that leaves is truncated, and one that comes joins.

    Observations are (D,) float32, columns named by `BatchEnv.observation_names`. Rewards are
    floats. An info holds ``reward_components`` (name to float; they add up to the reward) and
    ``rescues`` (number of this step's rescues in which the robot helped); where the scenario has
    deadlines also ``lost`` (number of victims that were lost in this step); and where victims
    arrive by themselves ``turned_away`` (number of those that found no slot in this step). Where a
    robot may be unable to act, its info has an ``action_mask``, also after a reset: (5,) int8, 1
    for the discrete actions that have an effect in the next step.
    """

    metadata: ClassVar[dict[str, Any]] = {
        "name": "innerattn_v0",
        "render_modes": usable_modes(_MODES),
        "is_parallelizable": True,
        "render_fps": STEPS_PER_SECOND,
    }

    def __init__(self, scenario: Scenario, render_mode: str | None, seed: int | None) -> None:
        """See `parallel_env`."""
        self.scenario = scenario
        self.render_mode = render_mode
        self.max_cycles = scenario.episode_steps
        self._screen = Screen(render_mode, _MODES)
        first_seed = seed_or_random(seed)
        self._env = BatchEnv(
            scenario,
            1,
            first_seed,
            num_threads=1,
            autoreset="disabled",
            copy=False,
        )
        self.possible_agents = list(self._env.robot_names)
        self.agents: list[str] = []
        self._started, self._over = False, True
        self.np_random = np.random.default_rng(first_seed)
        """For wrappers that draw at random, such as SuperSuit's; the world does not use it."""
        self.observation_spaces = robot_observation_spaces(scenario)
        self.action_spaces = robot_action_spaces(scenario)
        self.state_space = state_space(scenario)

    def observation_space(self, agent: str) -> spaces.Space[Obs]:
        """The space of the agent's observations, the same object at every call."""
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> spaces.Space[Action]:
        """The space of the agent's actions, the same object at every call."""
        return self.action_spaces[agent]

    def reset(
        self,
        seed: int | None = None,
        options: dict[str, Any] | None = None,  # noqa: ARG002
    ) -> tuple[dict[str, Obs], dict[str, Info]]:
        """Start the next episode; with ``seed`` the first one of that seed.

        ``options`` is accepted as the interface asks, and not used.
        """
        obs = self._env.reset(seed)
        if seed is not None:
            self.np_random = np.random.default_rng(seed)
        self._started, self._over = True, False
        self.agents = self._present()
        self._screen.follow(self._env)
        infos: dict[str, Info] = {agent: {} for agent in self.agents}
        return self._by_agent(obs[0], self.agents), self._with_masks(infos)

    def step(
        self, actions: dict[str, Action]
    ) -> tuple[dict[str, Obs], dict[str, float], dict[str, bool], dict[str, bool], dict[str, Info]]:
        """Let every live agent act for one control step.

        Raises:
            gymnasium.error.ResetNeeded: no episode is going on.
            ValueError: an action is missing, is of no live agent, or is out of range.
            TypeError: an action is of the wrong type, or ``actions`` is no dict.
        """
        agents = self.agents
        if not isinstance(actions, dict):
            raise TypeError(f"actions is a {type(actions).__name__}: must be a dict by agent")
        if self._over:
            raise ResetNeeded("no episode is going on: call reset() before step()")
        if actions.keys() != set(agents):
            wrong = sorted(actions.keys() ^ set(agents))
            raise ValueError(f"actions must be of the live agents {agents}; differs in {wrong}")
        given = {agent: self.checked_action(agent, actions[agent]) for agent in agents}
        continuous = self.scenario.actions == "continuous"
        still = np.zeros(2, np.float32) if continuous else np.int64(0)  # of those who have left
        step = self._env.step(np.stack([[given.get(one, still) for one in self.possible_agents]]))
        self._screen.follow(self._env)
        terminated, truncated = bool(step.terminated[0]), bool(step.truncated[0])
        there = self._present()
        seen = [one for one in self.possible_agents if one in agents or one in there]
        self._over = terminated or truncated
        self.agents = [] if self._over else there
        return (
            self._by_agent(step.obs[0], seen),
            self._of(step.reward[0].tolist(), seen),
            dict.fromkeys(seen, terminated),
            {one: truncated or one not in there for one in seen},
            self._with_masks(self._infos(step.rescues, seen)),
        )

    def checked_action(self, agent: str, action: Action) -> NDArray[Any]:
        """An action as the worlds take it; whether it is in range they say themselves.

        Raises:
            TypeError: no integer; no two numbers where actions are continuous.
            ValueError: another shape.
        """
        continuous = self.scenario.actions == "continuous"
        kinds, shape, dtype = ("fiu", (2,), np.float32) if continuous else ("iu", (), np.int64)
        given = np.asarray(action)
        if given.dtype.kind not in kinds:
            wanted = "two numbers" if continuous else "an integer"
            raise TypeError(f"actions[{agent!r}] = {action!r}: must be {wanted}")
        if given.shape != shape:
            raise ValueError(f"actions[{agent!r}] has shape {given.shape}: must be {shape}")
        return given.astype(dtype)

    def state(self) -> NDArray[np.float32]:
        """The whole world, (S,) float32; `BatchEnv.state` has the columns.

        Raises:
            gymnasium.error.ResetNeeded: no episode has started yet.
        """
        self._need_start("state")
        return self._env.state().reshape(-1)

    def render(self) -> NDArray[np.uint8] | None:
        """The world as an (H, W, 3) picture, or none where `render_mode` is none or "human".

        Raises:
            gymnasium.error.ResetNeeded: no episode has started yet.
        """
        if self.render_mode is None:
            return None
        self._need_start("render")
        return self._screen.show(self._env)

    def close(self) -> None:
        """Free the world; the environment cannot be used afterwards."""
        self._env.close()
        self._screen.close()

    def _need_start(self, what: str) -> None:
        if not self._started:
            raise ResetNeeded(f"no episode has started: call reset() before {what}()")

    def _present(self) -> list[str]:
        """The robots in the arena."""
        present = self._env.present()[0].tolist()
        return [one for one, is_in in zip(self.possible_agents, present, strict=True) if is_in]

    def _of(self, values: Sequence[Any], agents: Sequence[str]) -> dict[str, Any]:
        """The values of some agents, from those of all robots."""
        every = dict(zip(self.possible_agents, values, strict=True))
        return {agent: every[agent] for agent in agents}

    def _by_agent(self, rows: NDArray[np.float32], agents: Sequence[str]) -> dict[str, Obs]:
        return self._of([row.copy() for row in rows], agents)

    def _with_masks(self, infos: dict[str, Info]) -> dict[str, Info]:
        """Infos by agent, with action masks where there are any."""
        if self.scenario.has_action_masks:
            masks = self._of(list(self._env.action_mask()[0].astype(np.int8)), list(infos))
            for agent, info in infos.items():
                info["action_mask"] = masks[agent]
        return infos

    def _infos(self, rescues: NDArray[np.void], agents: Sequence[str]) -> dict[str, Info]:
        names = self._env.reward_component_names
        gone = {"lost": len(self._env.lost())} if self._env.scenario.has_deadlines else {}
        if self._env.scenario.has_arrivals:
            gone["turned_away"] = int(self._env.turned_away()[0])
        helpers = [rescues[name] for name in rescues.dtype.names or () if name.startswith("helper")]
        found = [
            {
                "reward_components": dict(zip(names, row, strict=True)),
                "rescues": sum(int((column == i).sum()) for column in helpers),
                **gone,
            }
            for i, row in enumerate(self._env.reward_components()[0].tolist())
        ]
        return self._of(found, agents)
