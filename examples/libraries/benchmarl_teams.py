"""BenchMARL's MAPPO or MASAC on `RescueTorchRLEnv`, through a task of our own."""

from __future__ import annotations

import tempfile
from collections.abc import Callable

import torch
from benchmarl.algorithms import MappoConfig, MasacConfig
from benchmarl.environments.common import Task, TaskClass
from benchmarl.experiment import Experiment, ExperimentConfig
from benchmarl.models.mlp import MlpConfig
from numpy.typing import NDArray
from scoring import Stopwatch, options, report
from tensordict import TensorDict
from torchrl.data import Composite
from torchrl.envs import EnvBase
from torchrl.envs.utils import ExplorationType, set_exploration_type

from innerattn.config import Scenario
from innerattn.envs import RescueTorchRLEnv

ALGORITHMS = {"mappo": MappoConfig, "masac": MasacConfig}


class RescueClass(TaskClass):
    """What BenchMARL asks of a task."""

    def get_env_fun(
        self, num_envs: int, continuous_actions: bool, seed: int | None, device: torch.device
    ) -> Callable[[], EnvBase]:
        """A function that makes the worlds."""
        actions = "continuous" if continuous_actions else "discrete"
        return lambda: RescueTorchRLEnv(
            self.config["situation"], num_envs, seed=seed, device=device, actions=actions
        )

    def supports_continuous_actions(self) -> bool:
        """Yes; this program uses discrete ones."""
        return True

    def supports_discrete_actions(self) -> bool:
        """Yes."""
        return True

    def has_render(self, env: EnvBase) -> bool:  # noqa: ARG002
        """Not through TorchRL."""
        return False

    def max_steps(self, env: EnvBase) -> int:
        """Length of an episode [control steps]."""
        return env.scenario.episode_steps

    def group_map(self, env: EnvBase) -> dict[str, list[str]]:
        """Names of the robots of each kind."""
        return env.group_map

    def observation_spec(self, env: EnvBase) -> Composite:
        """Observations of each kind."""
        return self._of_kinds(env, env.observation_spec_unbatched)

    def state_spec(self, env: EnvBase) -> Composite:
        """The state of a world, for the critic."""
        return Composite(state=env.observation_spec_unbatched["state"])

    def action_spec(self, env: EnvBase) -> Composite:
        """Actions of each kind."""
        return env.full_action_spec_unbatched

    def info_spec(self, env: EnvBase) -> Composite | None:  # noqa: ARG002
        """Nothing more is told."""
        return None

    def action_mask_spec(self, env: EnvBase) -> Composite | None:  # noqa: ARG002
        """All actions are allowed."""
        return None

    @staticmethod
    def env_name() -> str:
        """The name in BenchMARL's logs."""
        return "innerattn"

    def _of_kinds(self, env: EnvBase, spec: Composite) -> Composite:
        return Composite({kind: spec[kind].clone() for kind in env.group_map})


class RescueTask(Task):
    """The tasks: one, whose situation is in its configuration."""

    RESCUE = None

    @staticmethod
    def associated_class() -> type[TaskClass]:
        """What the tasks are made of."""
        return RescueClass


def configured(algorithm: str, env_steps: int, folder: str) -> ExperimentConfig:
    """BenchMARL's own defaults but for lengths, rates and logs."""
    config = ExperimentConfig.get_from_yaml()
    config.prefer_continuous_actions = False
    config.max_n_frames = env_steps
    config.gamma, config.lr = 0.98, 2e-3 if algorithm == "mappo" else 1e-3
    config.on_policy_n_envs_per_worker = 64
    config.on_policy_collected_frames_per_batch = 1_600
    config.on_policy_n_minibatch_iters = 4
    config.on_policy_minibatch_size = 1_600
    config.off_policy_n_envs_per_worker = 64
    config.off_policy_collected_frames_per_batch = 1_600
    config.off_policy_n_optimizer_steps = 60
    config.off_policy_train_batch_size = 256
    config.off_policy_memory_size = 100_000
    config.evaluation = config.render = config.create_json = False
    config.loggers = []
    config.save_folder = folder
    return config


def main() -> None:
    """Train for a number of env-steps and score the team."""
    algorithms = {"choices": list(ALGORITHMS), "default": "mappo"}
    given = options(__doc__, 200_000, algorithm=algorithms)
    algorithm = ALGORITHMS[given.algorithm].get_from_yaml()
    if given.algorithm == "masac":
        algorithm.alpha_init = 0.01  # rewards are small: more entropy would hide them
    with tempfile.TemporaryDirectory() as folder:
        experiment = Experiment(
            task=RescueTask.RESCUE.get_task({"situation": given.situation}),
            algorithm_config=algorithm,
            model_config=MlpConfig(
                num_cells=[64, 64], activation_class=torch.nn.Tanh, layer_class=torch.nn.Linear
            ),
            seed=given.seed,
            config=configured(given.algorithm, given.env_steps, folder),
        )
        watch = Stopwatch()
        experiment.run()
        spent = watch.stop()

    kinds = experiment.group_map
    names = [robot.name for robot in Scenario.preset(given.situation).robots]

    def actor(obs: NDArray) -> NDArray:
        seen = {
            kind: {"observation": torch.from_numpy(obs[:, [names.index(one) for one in robots]])}
            for kind, robots in kinds.items()
        }
        with torch.no_grad(), set_exploration_type(ExplorationType.DETERMINISTIC):
            acted = experiment.policy(TensorDict(seen, batch_size=[len(obs)]))
        chosen = {
            name: acted[kind, "action"][:, place]
            for kind, robots in kinds.items()
            for place, name in enumerate(robots)
        }
        return torch.stack([chosen[name] for name in names], dim=1).numpy()

    report("benchmarl", given.algorithm.upper(), given, experiment.total_frames, spent, actor)


if __name__ == "__main__":
    main()
