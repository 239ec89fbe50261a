"""Stable-Baselines3's PPO with one policy for all robots, on the PettingZoo or the Gymnasium view.

PPO sees a row for each robot. A row is what the robot observes, then who it is (one of R).
`--view pettingzoo` goes through SuperSuit; `--view gymnasium` through `RobotRows` below.
"""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import supersuit
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray
from scoring import Stopwatch, options, report
from stable_baselines3 import PPO
from stable_baselines3.common.utils import set_random_seed
from stable_baselines3.common.vec_env import VecEnv

import innerattn  # noqa: F401  (makes the name known to Gymnasium)
from innerattn.config import Scenario
from innerattn.envs import parallel_env

WORLDS, STEPS = 64, 25
PPO_NUMBERS: dict[str, Any] = {
    "n_steps": STEPS,
    "batch_size": WORLDS * STEPS,
    "n_epochs": 4,
    "learning_rate": 2e-3,
    "gamma": 0.98,
    "gae_lambda": 0.9,
    "ent_coef": 0.01,
}


def with_names(obs: NDArray[np.float32]) -> NDArray[np.float32]:
    """Observations (E, R, D) as rows (E * R, D + R), with who each robot is."""
    worlds, robots, _ = obs.shape
    who = np.broadcast_to(np.eye(robots, dtype=np.float32), (worlds, robots, robots))
    return np.concatenate([obs, who], axis=2).reshape(worlds * robots, -1)


class RobotRows(VecEnv):
    """A Gymnasium `VectorEnv` of teams as a `VecEnv` of single robots, E * R rows.

    Args:
        envs: with same-step autoreset.
    """

    def __init__(self, envs: gymnasium.vector.VectorEnv) -> None:
        self.envs = envs
        low, high = (with_names(bound[None])[0] for bound in self._bounds())
        self.robots = envs.single_observation_space.shape[0]
        low[-self.robots :], high[-self.robots :] = 0.0, 1.0
        rows = envs.num_envs * self.robots
        actions = gymnasium.spaces.Discrete(int(envs.single_action_space.nvec[0]))
        super().__init__(rows, gymnasium.spaces.Box(low, high), actions)

    def reset(self) -> NDArray[np.float32]:
        """Rows (E * R, D + R) of new episodes."""
        return with_names(self.envs.reset()[0])

    def step_async(self, actions: NDArray[np.int64]) -> None:
        """Keep actions (E * R,) for `step_wait`."""
        self._actions = actions.reshape(-1, self.robots)

    def step_wait(self) -> tuple[Any, ...]:
        """Rows, rewards and ends (E * R,), and an info for each row."""
        obs, _, terminated, truncated, infos = self.envs.step(self._actions)
        rewards = sum(  # of worlds that go on, and of worlds whose episode ended
            found["robot_rewards"]
            for found in (infos, infos.get("final_info", {}))
            if "robot_rewards" in found
        )
        ended = np.repeat(terminated | truncated, self.robots)
        told: list[dict[str, Any]] = [{} for _ in ended]
        for row in np.flatnonzero(ended):
            world, robot = divmod(int(row), self.robots)
            told[row] = {
                "terminal_observation": with_names(infos["final_obs"][world][None])[robot],
                "TimeLimit.truncated": not terminated[world],
            }
        return with_names(obs), np.asarray(rewards).reshape(-1), ended, told

    def close(self) -> None:
        """Free the worlds."""
        self.envs.close()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """An attribute of the batch, once for each row."""
        return [getattr(self.envs, attr_name, None)] * len(self._get_indices(indices))

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Rows share one batch, so no row has attributes of its own."""
        raise NotImplementedError(attr_name)

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **named: Any) -> Any:
        """Rows share one batch, so no row has methods of its own."""
        raise NotImplementedError(method_name)

    def env_is_wrapped(
        self,
        wrapper_class: Any,  # noqa: ARG002
        indices: Any = None,
    ) -> list[bool]:
        """No row is wrapped."""
        return [False] * len(self._get_indices(indices))

    def _bounds(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        space = self.envs.single_observation_space
        return space.low, space.high


def worlds(view: str, situation: str, seed: int) -> VecEnv:
    """`WORLDS` worlds, a row for each robot."""
    if view == "gymnasium":
        mode = AutoresetMode.SAME_STEP
        name = "innerattn/Rescue-v0"
        return RobotRows(
            gymnasium.make_vec(
                name, num_envs=WORLDS, scenario=situation, seed=seed, autoreset_mode=mode
            )
        )
    one = supersuit.agent_indicator_v0(parallel_env(situation, seed=seed))
    rows = supersuit.pettingzoo_env_to_vec_env_v1(one)
    env = supersuit.concat_vec_envs_v1(rows, WORLDS, base_class="stable_baselines3")
    env.venv.reset(seed=seed)  # each world gets a seed of its own; they were copies of one
    return env


def main() -> None:
    """Train for a number of env-steps and score the team."""
    views = {"choices": ["gymnasium", "pettingzoo"], "default": "gymnasium"}
    given = options(__doc__, 200_000, view=views)
    robots = len(Scenario.preset(given.situation).robots)
    set_random_seed(given.seed)
    env = worlds(given.view, given.situation, given.seed)
    model = PPO("MlpPolicy", env, device="cpu", **PPO_NUMBERS)
    watch = Stopwatch()
    model.learn(given.env_steps * robots)
    spent = watch.stop()
    env.close()

    def actor(obs: NDArray[np.float32]) -> NDArray[np.int64]:
        chosen, _ = model.predict(with_names(obs), deterministic=True)
        return chosen.reshape(len(obs), robots)

    algorithm = f"PPO, {given.view} view"
    report("stable-baselines3", algorithm, given, model.num_timesteps // robots, spent, actor)


if __name__ == "__main__":
    main()
