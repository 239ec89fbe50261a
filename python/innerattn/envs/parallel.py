"""One rescue world behind PettingZoo's parallel interface, for tools that speak it.

It steps a single world through `BatchEnv`; for training at speed use `BatchEnv` itself.
"""

from __future__ import annotations

from importlib.util import find_spec
from typing import TYPE_CHECKING, Any, ClassVar, TypeAlias

import numpy as np
from gymnasium import spaces
from gymnasium.error import ResetNeeded
from numpy.typing import NDArray
from pettingzoo import ParallelEnv

from innerattn.config import Scenario
from innerattn.envs.batch import BatchEnv
from innerattn.envs.render import draw_world, paint_figure
from innerattn.envs.window import Window
from innerattn.errors import ConfigError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Obs: TypeAlias = NDArray[np.float32]
Action: TypeAlias = Any  # an integer, or (2,) float32 where actions are continuous
Info: TypeAlias = dict[str, Any]


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
        render_mode: none; "rgb_array" for `render` to give pictures; or "human" for a window that
            `reset` and `step` keep up to date, at most `metadata["render_fps"]` times a second.
        seed: seed of the episodes until `reset` is given one; none: a random one.
        overrides: fields of `Scenario` to change.

    Raises:
        ConfigError: unknown preset, field or render mode, an invalid value, or no matplotlib or no
            display to draw on.
        TypeError: ``scenario`` or ``seed`` is of another type.
        ValueError: ``seed`` is out of range.
    """
    if not isinstance(scenario, (Scenario, str)):
        raise TypeError(f"scenario = {scenario!r}: must be a Scenario or the name of a preset")
    if isinstance(scenario, str):
        scenario = Scenario.preset(scenario)
    if max_cycles is not None:
        if "episode_steps" in overrides:
            raise ConfigError("max_cycles and episode_steps are the same: give one of them")
        overrides["episode_steps"] = max_cycles
    return RescueParallelEnv(scenario.replace(**overrides), render_mode, seed)


class RescueParallelEnv(ParallelEnv[str, Obs, Action]):  # type: ignore[misc]
    """One rescue world; made by `parallel_env`.

    Agents are the robots' names. All of them live until the episode ends, by truncation after
    `episode_steps` or by termination where the scenario asks for it, and leave together.

    Observations are (D,) float32, columns named by `BatchEnv.observation_names`. Rewards are
    floats. An info holds ``reward_components`` (name to float; they add up to the reward) and
    ``rescues`` (number of this step's rescues in which the robot helped).
    """

    metadata: ClassVar[dict[str, Any]] = {
        "name": "innerattn_v0",
        "render_modes": ["human", "rgb_array"],
        "is_parallelizable": True,
        "render_fps": 10,
    }

    def __init__(self, scenario: Scenario, render_mode: str | None, seed: int | None) -> None:
        """See `parallel_env`."""
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise ConfigError(
                f"render_mode = {render_mode!r}: must be None, 'human' or 'rgb_array'"
            )
        if render_mode is not None and find_spec("matplotlib") is None:
            raise ConfigError(
                f"render_mode = {render_mode!r}: needs matplotlib; install innerattn[figures]"
            )
        if seed is None:
            seed = int(np.random.default_rng().integers(2**63))
        self.scenario = scenario
        self.render_mode = render_mode
        self.max_cycles = scenario.episode_steps
        self._env = BatchEnv(scenario, 1, seed, num_threads=1, autoreset="disabled", copy=False)
        self.possible_agents = list(self._env.robot_names)
        self.agents: list[str] = []
        self._started = False
        self._window = (
            Window(f"innerattn, {scenario.situation}", self.metadata["render_fps"])
            if render_mode == "human"
            else None
        )
        width = self._env.obs_width
        self.observation_spaces = {
            name: spaces.Box(-np.inf, np.inf, (width,), np.float32) for name in self.possible_agents
        }
        self.action_spaces = {name: self._new_action_space() for name in self.possible_agents}
        size = 4 * scenario.num_robots + 2 * len(scenario.obstacles)
        size += (len(scenario.tasks) + 2) * scenario.num_victims
        self.state_space = spaces.Box(-np.inf, np.inf, (size,), np.float32)

    def _new_action_space(self) -> spaces.Space[Any]:
        if self.scenario.actions == "continuous":
            return spaces.Box(-1.0, 1.0, (2,), np.float32)
        return spaces.Discrete(self._env.num_actions)

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
        self._started = True
        self.agents = self.possible_agents.copy()
        self._show()
        return self._by_agent(obs[0]), {agent: {} for agent in self.agents}

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
        if not agents:
            raise ResetNeeded("no episode is going on: call reset() before step()")
        if actions.keys() != set(agents):
            wrong = sorted(actions.keys() ^ set(agents))
            raise ValueError(f"actions must be of the live agents {agents}; differs in {wrong}")
        step = self._env.step(
            np.stack([[self._checked(agent, actions[agent]) for agent in agents]])
        )
        terminated, truncated = bool(step.terminated[0]), bool(step.truncated[0])
        if terminated or truncated:
            self.agents = []
        self._show()
        return (
            self._by_agent(step.obs[0]),
            dict(zip(agents, step.reward[0].tolist(), strict=True)),
            dict.fromkeys(agents, terminated),
            dict.fromkeys(agents, truncated),
            self._infos(step.rescues),
        )

    def _checked(self, agent: str, action: Action) -> NDArray[Any]:
        """An action as the worlds take it; whether it is in range they say themselves."""
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
        """The whole world, of shape `state_space.shape`, float32, world frame.

        For each robot x, y [m] and x, y velocity [m/s]; for each victim slot one column per task
        (1 where such a victim is present), x, y [m]; for each obstacle x, y [m]. Empty slots are
        zeros.

        Raises:
            gymnasium.error.ResetNeeded: no episode has started yet.
        """
        self._need_start("state")
        robots = np.concatenate([self._env.positions()[0], self._env.velocities()[0]], axis=1)
        victims = self._env.victims()[0]
        present = victims["present"].astype(bool)
        is_task = victims["task"][:, None] == np.arange(len(self.scenario.tasks))
        slots = np.column_stack([is_task, victims["x"], victims["y"]])
        slots = np.where(present[:, None], slots, 0.0)
        parts = [robots, slots, self._env.obstacles()[0]]
        return np.concatenate([np.ravel(part) for part in parts], dtype=np.float32)

    def render(self) -> NDArray[np.uint8] | None:
        """The world as an (H, W, 3) picture where `render_mode` is "rgb_array", else none.

        With "human" it brings the window up to date, as `reset` and `step` do by themselves.

        Raises:
            gymnasium.error.ResetNeeded: no episode has started yet.
        """
        if self.render_mode is None:
            return None
        self._need_start("render")
        self._show()
        if self.render_mode == "human":
            return None
        return draw_world(self.scenario, *self._drawn(), title=self._title())

    def close(self) -> None:
        """Free the world and close the window; the environment cannot be used afterwards."""
        self._env.close()
        if self._window is not None:
            self._window.close()

    def _show(self) -> None:
        """Bring the window up to date, if there is one."""
        if self._window is not None:
            self._window.update(self._paint)

    def _paint(self, figure: Figure) -> None:
        paint_figure(figure, self.scenario, *self._drawn(), title=self._title())

    def _drawn(self) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any], NDArray[Any]]:
        env = self._env
        return env.positions()[0], env.velocities()[0], env.victims()[0], env.obstacles()[0]

    def _title(self) -> str:
        return f"step {int(self._env.step_counts()[0])} of {self.scenario.episode_steps}"

    def _need_start(self, what: str) -> None:
        if not self._started:
            raise ResetNeeded(f"no episode has started: call reset() before {what}()")

    def _by_agent(self, rows: NDArray[np.float32]) -> dict[str, Obs]:
        return {agent: rows[i].copy() for i, agent in enumerate(self.possible_agents)}

    def _infos(self, rescues: NDArray[np.void]) -> dict[str, Info]:
        names = self._env.reward_component_names
        helpers = [rescues[name] for name in rescues.dtype.names or () if name.startswith("helper")]
        return {
            agent: {
                "reward_components": dict(zip(names, row, strict=True)),
                "rescues": sum(int((column == i).sum()) for column in helpers),
            }
            for i, (agent, row) in enumerate(
                zip(self.possible_agents, self._env.reward_components()[0].tolist(), strict=True)
            )
        }
