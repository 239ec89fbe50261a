"""The newest policy of a run, also while its training goes on; nothing in the folder is trusted.

Links and paths that lead out of it are refused, and no file is unpickled.
"""

from __future__ import annotations

from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from torch import Tensor

from innerattn.config import RunConfig, Scenario
from innerattn.envs import BatchEnv
from innerattn.errors import RunError
from innerattn.learn.actor_critic import MOMENTS
from innerattn.learn.types import Learner
from innerattn.records.run_files import RunFiles
from innerattn.records.run_folder import config_of, weights_name
from innerattn.train.build import build_learner, refuse_larger_networks
from innerattn.train.weights import MOST_BYTES, weights_in
from innerattn.zoo import CARD, run_path

_TRIES = 5


@dataclass(frozen=True)
class NewestPolicy:
    """The newest policy of a run.

    Attributes:
        config: of the run.
        learner: with its newest weights.
        env_steps: done when these weights were saved.
    """

    config: RunConfig
    learner: Learner
    env_steps: int


def load_policy(
    run: str | Path, device: str = "cpu", scenario: Scenario | None = None
) -> tuple[RunConfig, Learner]:
    """The configuration of a run and a learner with its newest weights.

    Args:
        run: the run folder, or ``zoo:NAME``.
        device: where the networks are put; the device of training need not exist here.
        scenario: the worlds that a policy for any team is to act in; None: those of the run. Other
            policies act in their own.

    Raises:
        RunError: no run folder, none of ours, no checkpoint yet, or weights that are truncated,
            altered or of other networks.
        ConfigError: its ``config.toml`` is not valid.
    """
    newest = load_newest(run, device, scenario)
    return newest.config, newest.learner


def load_newest(
    run: str | Path, device: str = "cpu", scenario: Scenario | None = None
) -> NewestPolicy:
    """As `load_policy`, with the time of the weights; also while training saves newer ones.

    Raises:
        RunError, ConfigError: as of `load_policy`.
    """
    path = run_path(run)
    for _ in range(_TRIES - 1):
        files = RunFiles(path)
        if files.info.state != "running":
            break
        name = weights_name(files)
        try:
            return _load(files, name, device, scenario)
        except RunError:
            # A training drops old checkpoints; this one may be gone since its name was read.
            if weights_name(files) == name:
                raise
    files = RunFiles(path)
    return _load(files, weights_name(files), device, scenario)


def moments_in(state: dict[str, Tensor]) -> dict[str, Tensor]:
    """The part of a learner's state that acting does not need: the optimisers' moments."""
    return {name: tensor for name, tensor in state.items() if name.split(".")[0] in MOMENTS}


def _load(files: RunFiles, name: str, device: str, scenario: Scenario | None) -> NewestPolicy:
    config = config_of(files)
    train = config.train.model_copy(update={"device": device})
    weights = files.path / name
    known = files.info.weights_sha256 if files.info.state != "running" else None
    tensors = weights_in(files.read(name, MOST_BYTES), weights, known)
    worlds = config.scenario
    if scenario is not None and config.algorithm.for_any_team:
        worlds = scenario
    with closing(BatchEnv(worlds, 1, num_threads=1)) as env:
        refuse_larger_networks(config, env, tensors, weights)
        learner = build_learner(config.model_copy(update={"train": train}), env)
    try:
        if (files.path / CARD).is_file():  # a team of the zoo comes without moments
            tensors = moments_in(learner.state()) | tensors
        learner.load(tensors)
    except ValueError as error:
        raise RunError(f"{weights}: {error}") from error
    return NewestPolicy(config, learner, int(weights.parent.name))
