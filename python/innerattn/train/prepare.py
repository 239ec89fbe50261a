"""Prepares a training in this process: its worlds, its parts, and how they compute."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass

import torch

from innerattn.config import RunConfig
from innerattn.config.streams import stream_seed
from innerattn.envs import BatchEnv
from innerattn.learn import workers
from innerattn.train.build import keep_heap_small, torch_threads
from innerattn.train.checkpoint_info import Stage
from innerattn.train.compilation import compiles
from innerattn.train.interruption import Interruptions, remembered_interruptions
from innerattn.train.matmul_backend import chosen_matmul_backend, warn_of_slow_bfloat16
from innerattn.train.parts import Parts
from innerattn.train.teams.training import TeamTraining
from innerattn.train.training import Training


@dataclass(frozen=True)
class Prepared:
    """A training that can begin or go on.

    Attributes:
        parts: what it is made of; of several workers, this one's share.
        compiled: whether updates are compiled.
        matmul_backend: what multiplies matrices.
        interruptions: requests to stop.
    """

    parts: Training
    compiled: bool
    matmul_backend: str
    interruptions: Interruptions


@contextmanager
def prepared(
    config: RunConfig, threads: int, stage: Stage, *, compilable: bool = True
) -> Iterator[Prepared]:
    """Prepare a training that is in ``stage``; the worlds are closed at the end of the block.

    Args:
        config: the run.
        threads: of the networks.
        stage: where it is.
        compilable: whether updates may be compiled; worker 0 decides for all.

    Raises:
        ConfigError: the configuration cannot be run here.
    """
    keep_heap_small()
    of_any_team = config.algorithm.for_any_team
    if workers.rank() == 0:
        warn_of_slow_bfloat16(config.network.precision, config.train.device)
    with (
        torch_threads(threads),
        chosen_matmul_backend(config.train.matmul_backend) as matmul_backend,
        # A step of any team is a whole rollout.
        remembered_interruptions(every=1 if of_any_team else 8) as interruptions,
    ):
        if of_any_team:
            with closing(TeamTraining(config, stage)) as training:
                yield Prepared(training, False, matmul_backend, interruptions)
            return
        worlds = workers.share_of(config.train.num_envs)
        env = BatchEnv(
            config.training_scenario,
            worlds,
            seed=stream_seed(config.train.seed, "training"),
            num_threads=config.train.threads if workers.count() == 1 else threads,
            first_env=workers.rank() * worlds,
            copy=False,
        )
        with closing(env):
            parts = Parts(config, env, stage)
            wanted = workers.rank() == 0 and compilable and compiles(config)
            compiled = bool(workers.of_first(torch.tensor(wanted)))
            if compiled:
                # The compiler counts the graphs of a process, and gives up after eight. Those of
                # earlier runs are of no use to this one, which shall be compiled, too.
                torch.compiler.reset()
                parts.compile()
            yield Prepared(parts, compiled, matmul_backend, interruptions)
