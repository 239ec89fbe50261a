"""RLlib's PPO on the PettingZoo view: a policy of its own for each robot.

Ray listens on this machine alone, and is shut down at the end, whatever happens.
"""

from __future__ import annotations

import os

os.environ["RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER"] = "0"  # no cluster: Ray takes the loopback address
os.environ["RAY_USAGE_STATS_ENABLED"] = "0"

import ray
import torch
from numpy.typing import NDArray
from ray.rllib.algorithms.ppo import PPOConfig
from ray.rllib.env.wrappers.pettingzoo_env import ParallelPettingZooEnv
from ray.tune.registry import register_env
from scoring import Stopwatch, options, report

from innerattn.config import Scenario
from innerattn.envs import parallel_env


def configured(situation: str, seed: int, robots: list[str]) -> PPOConfig:
    """PPO's numbers; all worlds are stepped in this process."""
    register_env("rescue", lambda _: ParallelPettingZooEnv(parallel_env(situation, seed=seed)))
    return (
        PPOConfig()
        .environment("rescue")
        .env_runners(num_env_runners=0, rollout_fragment_length=400)
        .multi_agent(policies=set(robots), policy_mapping_fn=lambda robot, *_, **__: robot)
        .training(
            train_batch_size_per_learner=1_600,
            minibatch_size=800,
            num_epochs=4,
            lr=2e-3,
            gamma=0.98,
            lambda_=0.9,
            entropy_coeff=0.01,
        )
        .rl_module(model_config={"fcnet_hiddens": [64, 64], "vf_share_layers": False})
        .debugging(seed=seed, log_level="ERROR")
    )


def main() -> None:
    """Train for a number of env-steps and score the team."""
    given = options(__doc__, 50_000)
    robots = [robot.name for robot in Scenario.preset(given.situation).robots]
    ray.init(_node_ip_address="127.0.0.1", include_dashboard=False, num_cpus=1, log_to_driver=False)
    try:
        algorithm = configured(given.situation, given.seed, robots).build_algo()
        watch, done = Stopwatch(), 0
        while done < given.env_steps:
            result = algorithm.train()
            done = int(result["env_runners"]["num_env_steps_sampled_lifetime"])
        spent = watch.stop()
        modules = [algorithm.get_module(robot) for robot in robots]

        def actor(obs: NDArray) -> NDArray:
            with torch.no_grad():
                logits = [
                    module.forward_inference({"obs": torch.from_numpy(obs[:, i].copy())})
                    for i, module in enumerate(modules)
                ]
            chosen = [one["action_dist_inputs"].argmax(dim=1) for one in logits]
            return torch.stack(chosen, dim=1).numpy()

        report("rllib", "PPO, one for each robot", given, done, spent, actor)
        algorithm.stop()
    finally:
        ray.shutdown()


if __name__ == "__main__":
    main()
