"""Run folders as training begins them, for tests that need a run but no skill."""

from contextlib import closing
from pathlib import Path

from innerattn.config import RunConfig, Scenario, load_run_config
from innerattn.envs import BatchEnv
from innerattn.train import RunFolder
from innerattn.train.build import build_learner


def run_config(method: str, **values: object) -> RunConfig:
    small = {"train.method": method, "train.threads": 1, "network.hidden_width": 8}
    return load_run_config("mixed", overrides={**small, **values})


def config_of_team(robots: int) -> RunConfig:
    """A configuration for the first of the standard team, with a task that one of them can do."""
    team = Scenario()
    task = team.tasks[0].model_copy(update={"needs": ("food",)})
    few = Scenario(situation="single", robots=team.robots[:robots], tasks=(task,))
    return RunConfig.model_validate({"scenario": few, "train": {"threads": 1}})


def make_run(folder: Path, config: RunConfig) -> Path:
    """A run folder with the weights that training begins with."""
    with closing(BatchEnv(config.scenario, 1, num_threads=1)) as env:
        learner = build_learner(config, env)
    run = RunFolder.create(folder, config, threads=1)
    run.save_weights(learner.state(), 0)
    run.mark("done", 0, 0, 0.0)
    return folder
