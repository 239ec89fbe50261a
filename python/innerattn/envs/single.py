"""One rescue world behind Gymnasium's interface: the whole team is one agent.

It steps a single world through `BatchEnv`; `innerattn.envs.RescueVectorEnv` steps many.
"""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
from gymnasium.error import ResetNeeded
from numpy.typing import NDArray

from innerattn.config.scenario import Scenario
from innerattn.envs.batch import BatchEnv
from innerattn.envs.spaces import state_space
from innerattn.envs.team import Form, TeamForm, team_rewards
from innerattn.envs.view import (
    STEPS_PER_SECOND,
    Screen,
    chosen_scenario,
    seed_or_random,
    usable_modes,
)

_MODES = ["human", "rgb_array"]


class RescueEnv(gymnasium.Env[Any, Any]):
    """One rescue world for `gymnasium.make("innerattn/Rescue-v0")`.

    The reward is the sum of all robots' rewards. An info holds ``robot_rewards``, (R,) float32, and
    ``rescues``, the number of this step's rescues; where the scenario has deadlines also ``lost``,
    the number of victims that were lost in it; and where victims arrive by themselves
    ``turned_away``, the number of those that found no slot in it. Where a robot may be unable to
    act, infos have an ``action_mask``, also after a reset: (R, 5) int8, 1 for the discrete actions
    that have an effect in the next step.

    Args:
        scenario: the world, or the name of a preset.
        render_mode: none; "rgb_array": `render` gives pictures; "human": a window shows every step.
        form: "joint": observations (R, D) float32, actions R integers, or (R, 2) floats where they
            are continuous; "agents": dicts by robot of (D,) and an integer or (2,).
        max_episode_steps: length of an episode [control steps]; none: the scenario's.
        seed: seed of the episodes until `reset` is given one; none: a random one.
        first_env: number of the world's random streams; see `BatchEnv`.
        overrides: fields of `Scenario` to change.

    Raises:
        ConfigError: unknown preset, field, form or render mode, or an invalid value.
        TypeError, ValueError: another value of another type, or out of range.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012  (as the base has it)
        "render_modes": usable_modes(_MODES),
        "render_fps": STEPS_PER_SECOND,
    }

    def __init__(
        self,
        scenario: Scenario | str = "mixed",
        *,
        render_mode: str | None = None,
        form: Form = "joint",
        max_episode_steps: int | None = None,
        seed: int | None = None,
        first_env: int = 0,
        **overrides: Any,
    ) -> None:
        scenario = chosen_scenario(scenario, max_episode_steps, "max_episode_steps", overrides)
        self.scenario = scenario
        self.render_mode = render_mode
        self._form = TeamForm(scenario, form)
        self._screen = Screen(render_mode, _MODES)
        self._env = BatchEnv(
            scenario,
            1,
            seed_or_random(seed),
            num_threads=1,
            autoreset="disabled",
            copy=False,
            first_env=first_env,
        )
        self._going_on = False
        self.observation_space = self._form.observation_space
        self.action_space = self._form.action_space
        self.state_space = state_space(scenario)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Start the next episode; with ``seed`` the first one of that seed.

        ``options`` is accepted as the interface asks, and not used.
        """
        super().reset(seed=seed, options=options)
        obs = self._env.reset(seed)
        self._going_on = True
        self._screen.follow(self._env)
        return self._form.observed(obs[0]), self._masks()

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Let the team act for one control step.

        Raises:
            gymnasium.error.ResetNeeded: no episode is going on.
            ValueError: an action is missing, of an unknown robot, or out of range.
            TypeError: an action is of the wrong type.
        """
        if not self._going_on:
            raise ResetNeeded("no episode is going on: call reset() before step()")
        step = self._env.step(self._form.actions(action)[None])
        terminated, truncated = bool(step.terminated[0]), bool(step.truncated[0])
        self._going_on = not (terminated or truncated)
        self._screen.follow(self._env)
        info = {"robot_rewards": step.reward[0].copy(), "rescues": len(step.rescues)}
        if self._env.scenario.has_deadlines:
            info["lost"] = len(self._env.lost())
        if self._env.scenario.has_arrivals:
            info["turned_away"] = int(self._env.turned_away()[0])
        reward = float(team_rewards(step.reward)[0])
        info |= self._masks()
        return self._form.observed(step.obs[0]), reward, terminated, truncated, info

    def action_masks(self) -> NDArray[np.bool_]:
        """Which discrete actions have an effect in the next step, (R * 5,) bool, robot by robot.

        It is what sb3-contrib's MaskablePPO asks for.
        """
        return self._env.action_mask().reshape(-1)

    def _masks(self) -> dict[str, Any]:
        if self.scenario.has_action_masks:
            return {"action_mask": self._env.action_mask()[0].astype(np.int8)}
        return {}

    def state(self) -> NDArray[np.float32]:
        """The whole world, (S,) float32; `BatchEnv.state` has the columns."""
        return self._env.state().reshape(-1)

    def render(self) -> Any:
        """The world as an (H, W, 3) picture, or none where `render_mode` is none or "human"."""
        return self._screen.show(self._env)

    def close(self) -> None:
        """Free the world; the environment cannot be used afterwards."""
        self._env.close()
        self._screen.close()
