"""Env-steps per second of BenchMARL's MAPPO in worlds of VMAS, training included.

It runs in the environment of `examples/libraries/benchmarl_teams.py`, with VMAS from the extra
`peers`, and prints the number. Rollouts, epochs, minibatches and width are those of our `fast`.
"""

from __future__ import annotations

import argparse
import tempfile
import time

import torch
from benchmarl.algorithms import MappoConfig
from benchmarl.environments import VmasTask
from benchmarl.experiment import Callback, Experiment, ExperimentConfig
from benchmarl.models.mlp import MlpConfig
from tensordict import TensorDictBase

AGENTS, WORLDS, STEPS, WIDTH = 4, 1_024, 25, 64
WARM_UP = 2
"""Rollouts before the clock starts."""


class Clock(Callback):
    """Notes when each rollout has been trained on."""

    def __init__(self) -> None:
        """Nothing was seen."""
        super().__init__()
        self.times: list[float] = []

    def on_train_end(self, training_td: TensorDictBase, group: str) -> None:  # noqa: ARG002
        """One of them is done; the agents of navigation are one group."""
        self.times.append(time.perf_counter())


def env_steps_per_second(rollouts: int, threads: int) -> float:
    """The pace after the warm-up.

    Args:
        rollouts: That count.
        threads: Of PyTorch.
    """
    torch.set_num_threads(threads)
    config = ExperimentConfig.get_from_yaml()
    config.prefer_continuous_actions = False
    config.on_policy_n_envs_per_worker = WORLDS
    config.on_policy_collected_frames_per_batch = WORLDS * STEPS
    config.on_policy_n_minibatch_iters = 2
    config.on_policy_minibatch_size = 512
    config.max_n_frames = WORLDS * STEPS * (rollouts + WARM_UP)
    config.evaluation = config.render = config.create_json = False
    config.loggers = []
    clock = Clock()
    with tempfile.TemporaryDirectory() as folder:
        config.save_folder = folder
        task = VmasTask.NAVIGATION.get_from_yaml()
        task.config |= {"n_agents": AGENTS, "max_steps": 50}
        model = MlpConfig(
            num_cells=[WIDTH, WIDTH], activation_class=torch.nn.Tanh, layer_class=torch.nn.Linear
        )
        Experiment(
            task=task,
            algorithm_config=MappoConfig.get_from_yaml(),
            model_config=model,
            seed=0,
            config=config,
            callbacks=[clock],
        ).run()
    seconds = clock.times[-1] - clock.times[WARM_UP - 1]
    return WORLDS * STEPS * rollouts / seconds


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rollouts", type=int, default=8)
    parser.add_argument("--threads", type=int, default=2)
    given = parser.parse_args()
    print(env_steps_per_second(given.rollouts, given.threads))


if __name__ == "__main__":
    main()
