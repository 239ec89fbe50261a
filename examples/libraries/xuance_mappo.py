"""XuanCe's MAPPO on the PettingZoo view: robots share a policy that is told who each robot is."""

from __future__ import annotations

import os
import tempfile
from argparse import Namespace
from pathlib import Path
from typing import Any

import numpy as np
import torch
import xuance
from numpy.typing import NDArray
from scoring import Stopwatch, options, report
from xuance.environment import REGISTRY_MULTI_AGENT_ENV, RawMultiAgentEnv, make_envs
from xuance.torch.agents import MAPPO_Agents

from innerattn.envs import parallel_env

WORLDS, STEPS = 64, 25


class RescueWorld(RawMultiAgentEnv):
    """A rescue world as XuanCe expects it.

    Args:
        config: has ``env_id``, the name of a preset, and ``env_seed``.
    """

    def __init__(self, config: Namespace) -> None:
        super().__init__()
        self.env = parallel_env(config.env_id, seed=config.env_seed)
        self.agents = self.env.possible_agents
        self.num_agents = len(self.agents)
        self.state_space = self.env.state_space
        self.observation_space = self.env.observation_spaces
        self.action_space = self.env.action_spaces
        self.agent_groups = [self.agents]
        self.max_episode_steps = self.env.max_cycles

    def reset(self) -> tuple[dict[str, Any], dict[str, Any]]:
        """Observations by robot, and an info."""
        obs, infos = self.env.reset()
        return obs, {"infos": infos}

    def step(self, actions: dict[str, Any]) -> tuple[Any, ...]:
        """Observations, rewards and ends by robot, the end by time, and an info."""
        chosen = {robot: int(action) for robot, action in actions.items()}
        obs, rewards, terminated, truncated, infos = self.env.step(chosen)
        return obs, rewards, terminated, all(truncated.values()), {"infos": infos}

    def state(self) -> NDArray[np.float32]:
        """The whole world, (S,)."""
        return self.env.state()

    def render(self, *_: Any) -> None:
        """No picture."""

    def close(self) -> None:
        """Free the world."""
        self.env.close()


def configured(situation: str, seed: int) -> Namespace:
    """XuanCe's numbers for MAPPO in MPE but for those of worlds, lengths and rates."""
    configs = Path(xuance.__file__).parent / "configs"
    numbers = xuance.load_yaml(str(configs / "basic.yaml"))
    numbers |= xuance.load_yaml(str(configs / "mappo" / "mpe" / "simple_spread_v3.yaml"))
    numbers |= {
        "env_name": "innerattn",
        "env_id": situation,
        "env_seed": seed,
        "seed": seed,
        "continuous_action": False,
        "policy": "Categorical_MAAC_Policy",
        "vectorize": "DummyVecMultiAgentEnv",
        "parallels": WORLDS,
        "buffer_size": WORLDS * STEPS,
        "n_epochs": 4,
        "learning_rate": 2e-3,
        "gamma": 0.98,
        "gae_lambda": 0.9,
        "render": False,
    }
    return Namespace(**numbers)


def main() -> None:
    """Train for a number of env-steps and score the team."""
    given = options(__doc__, 100_000)
    REGISTRY_MULTI_AGENT_ENV["innerattn"] = RescueWorld
    here = os.getcwd()
    with tempfile.TemporaryDirectory() as folder:  # logs go below the working directory
        os.chdir(folder)
        config = configured(given.situation, given.seed)
        envs = make_envs(config)
        team = MAPPO_Agents(config, envs)
        watch = Stopwatch()
        rounds = -(-given.env_steps // (WORLDS * STEPS))
        team.train(rounds * STEPS)
        spent = watch.stop()
        team.finish()
        envs.close()
        os.chdir(here)
    names = envs.agents

    def actor(obs: NDArray) -> NDArray:
        seen = [dict(zip(names, world, strict=True)) for world in obs]
        with torch.no_grad():
            acted = team.get_actions(seen, test_mode=True, deterministic=True)["actions"]
        return np.array([[int(world[name]) for name in names] for world in acted])

    report("xuance", "MAPPO", given, rounds * STEPS * WORLDS, spent, actor)


if __name__ == "__main__":
    main()
