"""Builds the learner that a configuration names, and sets up the process for training."""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from pkgutil import resolve_name

import torch
from torch import Tensor

from innerattn.config import RunConfig
from innerattn.config.registry import methods
from innerattn.cores import usable_cores
from innerattn.envs import BatchEnv
from innerattn.errors import ConfigError, RunError
from innerattn.learn.framed import FramedLearner
from innerattn.learn.networks import draw_networks
from innerattn.learn.types import Learner, LearnerClass, Team
from innerattn.nn import PartnerColumns, SquareSymmetry
from innerattn.policies.columns import able_columns
from innerattn.train.columns import entity_columns, hearing, partner_columns, state_columns
from innerattn.train.frames import turning_columns
from innerattn.train.teams.learner import team_networks, team_section
from innerattn.train.teams.policy import TeamPolicy


def build_learner(config: RunConfig, env: BatchEnv, *, training: bool = False) -> Learner:
    """A learner with initial weights for the team in ``env``, seeded by `train.seed`.

    Args:
        config: the run.
        env: worlds of its scenario.
        training: whether it will be trained; worlds are turned at random only then.

    Raises:
        ConfigError: the device does not exist here, or the scenario does not allow
            `network.symmetry`.
    """
    if config.algorithm.for_any_team:
        return TeamPolicy(config, env)
    names, team = env.observation_names(), team_of(config, env)
    make: LearnerClass = resolve_name(methods()[config.train.method].algorithm.learner)
    device = _device(config.train.device)
    learner = make(team, config.network, config.algorithm, seed=config.train.seed, device=device)
    if config.network.symmetry == "none":
        return learner
    drives = [robot.drive for robot in config.scenario.robots]
    symmetry = SquareSymmetry(turning_columns(config.scenario, names), device, drives)
    if config.network.symmetry == "canonical":
        states = None
        if config.algorithm.needs_afterstates:
            states = SquareSymmetry(state_columns(env.state_names()), device)
        return FramedLearner(learner, symmetry, None, states)
    return FramedLearner(learner, symmetry, config.train.seed) if training else learner


def refuse_larger_networks(
    config: RunConfig, env: BatchEnv, weights: Mapping[str, Tensor], path: Path
) -> None:
    """Refuse networks that the weights of a run cannot fill, before memory is spent on them.

    Args:
        config: the run, as it says of itself.
        env: worlds of its scenario.
        weights: everything learnt, by name.
        path: of the weights, for messages.

    Raises:
        RunError: the configuration asks for larger networks.
    """
    with torch.device("meta"):  # tensors have a shape and no memory there
        if config.algorithm.for_any_team:
            networks = team_networks(team_section(config))
        else:
            team, generator = team_of(config, env), torch.Generator("cpu")
            networks = draw_networks(team, config.network, generator, critic_outputs=1)
    least = sum(one.numel() for network in networks for one in network.parameters())
    found = sum(tensor.numel() for tensor in weights.values())
    if least > found:
        raise RunError(
            f"{path}: holds {found:,} numbers; the networks of config.toml have at least {least:,}"
        )


def team_of(config: RunConfig, env: BatchEnv) -> Team:
    """What learners know of the team in ``env``."""
    names, delay = env.observation_names(), env.scenario.message_delay_steps
    return Team(
        env.num_robots,
        env.obs_width,
        env.num_actions,
        kinds=tuple(robot.kind for robot in config.scenario.robots),
        availability_column=names.index("own.available"),
        entities=entity_columns(names) if config.network.encoder == "entities" else None,
        partners=_partners(config, names),
        action_width=2 if env.continuous else 0,
        state_width=len(env.state_names()) if config.algorithm.needs_afterstates else 0,
        swapped=_swapped(config),
        terminates=env.scenario.ends_early,
        hearing=hearing(names, delay) if config.network.message_width else None,
        able=able_columns(names) if config.network.mask_actions else (),
    )


def _partners(config: RunConfig, names: Sequence[str]) -> PartnerColumns | None:
    if config.network.attention != "oracle":
        return None
    return partner_columns(names, config.scenario.observed_teammates is None)


def _swapped(config: RunConfig) -> tuple[int, int] | None:
    names = config.network.swapped_robots
    if names is None:
        return None
    order = [robot.name for robot in config.scenario.robots]
    return order.index(names[0]), order.index(names[1])


_ROWS_PER_THREAD = 512


def thread_count(config: RunConfig) -> int:
    """Threads of the networks: `train.threads`, or one for every 512 rows of an update.

    A second thread gains little on small batches. Torch's threads wait for each other, so that two
    are many times slower than one where another program takes one of the cores.
    """
    if config.train.workers != 1:
        return config.train.threads or 1
    worth = max(1, config.algorithm.rows_per_update // _ROWS_PER_THREAD)
    return config.train.threads or min(worth, usable_cores())


def keep_heap_small() -> None:
    """Return large buffers to the system when they are freed, and keep small ones; glibc only.

    An update allocates and frees hundreds of aligned buffers. By default glibc comes to place them
    on its heap, which fragments and grows by gigabytes in an hour. To set that threshold fixes
    another one at 128 KiB: each free at the top of the heap would give pages back, and the next
    tensor would touch them anew.
    """
    trim_threshold, mmap_threshold = -1, -3
    mebibyte = 1024 * 1024
    if sys.platform == "linux":
        mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
        if mallopt is not None:
            mallopt(mmap_threshold, 4 * mebibyte)
            mallopt(trim_threshold, 256 * mebibyte)


@contextmanager
def torch_threads(count: int) -> Iterator[None]:
    """Let torch use ``count`` threads inside the block."""
    before = torch.get_num_threads()
    torch.set_num_threads(count)
    try:
        yield
    finally:
        torch.set_num_threads(before)


def _device(name: str) -> torch.device:
    try:
        device = torch.device(name)
        # A valid name may still be that of a device that is not here, or that stores no values.
        torch.zeros(1, device=device).item()
    except (RuntimeError, AssertionError) as error:
        count = torch.cuda.device_count()
        allowed = f"'cpu', 'cuda' or 'cuda:0' to 'cuda:{count - 1}'" if count else "'cpu'"
        none = "" if count else "; torch finds no CUDA device"
        raise ConfigError(
            f"train.device = {name!r}: not usable here, must be {allowed}{none}"
        ) from error
    return device
