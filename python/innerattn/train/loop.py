"""The training loop: imitate for a warm start; then collect, learn and log; save at the end.

It knows the `Learner` protocol and no algorithm, and does not evaluate.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import torch

from innerattn.config import RunConfig, Scenario
from innerattn.envs import BatchEnv
from innerattn.learn.types import Learner, Transitions
from innerattn.records.run_folder import State
from innerattn.train.attention_log import AttentionLog
from innerattn.train.build import (
    build_learner,
    keep_heap_small,
    thread_count,
    torch_threads,
)
from innerattn.train.checkpoint import RunFolder, refuse_existing
from innerattn.train.collect import Collector
from innerattn.train.compilation import compiles
from innerattn.train.imitate import Imitation
from innerattn.train.interruption import remembered_interruptions
from innerattn.train.matmul_backend import best_matmul_backend
from innerattn.train.metrics import Interval, Metrics, MetricsFile, refuse_divergence
from innerattn.train.potential import fitted_potential
from innerattn.train.schedule import Schedule

Stage = Literal["imitating", "training"]
Step = Callable[[float], tuple[Transitions, Mapping[str, float] | None]]
"""One control step of all worlds, from the share of the stage that is done to the transitions and
metrics by name."""


@dataclass(frozen=True)
class Progress:
    """How far training is; reported after every control step."""

    env_steps: int
    """Steps done in this stage, summed over worlds."""
    total_env_steps: int
    """Steps to do in this stage."""
    updates: int
    """Updates done in this stage; those of imitation do not count."""
    seconds: float
    """Time since this stage began [s]."""
    metrics: Metrics | None
    """The newest line of metrics, if there is one yet."""
    stage: Stage = "training"
    """A warm start imitates first; training is learning from rewards."""


def train(
    config: RunConfig,
    run_dir: str | Path,
    *,
    progress: Callable[[Progress], None] | None = None,
) -> Path:
    """Train as ``config`` says and leave a run folder.

    Args:
        config: the run.
        run_dir: where the run folder is made; nothing may be there yet.
        progress: called after every control step of all worlds.

    Returns:
        The run folder.

    Raises:
        RunError: ``run_dir`` exists or cannot be made, or training diverged.
        ConfigError: the configuration cannot be run here.
        KeyboardInterrupt: after the weights are saved and the state is set to "interrupted".
    """
    path = Path(run_dir)
    refuse_existing(path)
    keep_heap_small()
    threads = thread_count(config)
    with (
        torch_threads(threads),
        best_matmul_backend() as matmul_backend,
        remembered_interruptions() as check,
    ):
        env = BatchEnv(
            training_worlds(config),
            config.train.num_envs,
            seed=config.train.seed,
            num_threads=config.train.threads,
            copy=False,
        )
        with closing(env):
            learner = build_learner(config, env, training=True)
            schedule = Schedule(config, env, learner)
            collector = Collector(
                env,
                learner,
                torch.device(config.train.device),
                schedule,
                config.train.stagger_starts,
            )
            compiled = compiles(config)
            if compiled:
                learner.compile()
            warm = config.train.warm_start != "none"
            imitation = Imitation(config, env, learner, collector) if warm else None
            folder = RunFolder.create(path, config, threads, compiled, matmul_backend)
            loop = _Loop(config, folder, learner, collector, schedule, env, progress, check)
            loop.run(imitation)
    return path


def training_worlds(config: RunConfig) -> Scenario:
    """The scenario in which a run trains: its own, or with another engine or episode length."""
    chosen = {"episode_steps": config.train.episode_steps, "engine": config.train.engine}
    return config.scenario.replace(**{k: v for k, v in chosen.items() if v is not None})


class _Loop:
    """The state of one training run."""

    def __init__(
        self,
        config: RunConfig,
        folder: RunFolder,
        learner: Learner,
        collector: Collector,
        schedule: Schedule,
        env: BatchEnv,
        progress: Callable[[Progress], None] | None,
        check_interrupted: Callable[[], None],
    ) -> None:
        self._run, self._config = config, config.train
        self._folder = folder
        self._learner = learner
        self._collector = collector
        self._schedule, self._env = schedule, env
        self._attention = AttentionLog(env.robot_names, env.scenario.episode_steps)
        self._progress = progress
        self._check_interrupted = check_interrupted
        self._file = MetricsFile(folder.path / "metrics.jsonl")
        self._interval = Interval()
        self._metrics: Metrics | None = None
        self._env_steps = 0

    def run(self, imitation: Imitation | None) -> None:
        """Imitate, if there is a warm start, and learn to the end of the budget.

        A run that ends early is marked as interrupted. Its weights are saved only if the user
        interrupted it.
        """
        try:
            if self._run.train.potential != "none":
                self._fit_potential()
            if imitation is not None:
                self._do("imitating", imitation.env_steps, imitation.step)
            self._do("training", self._config.env_steps, self._step)
            self._save()
            self._mark("done")
        except KeyboardInterrupt:
            try:
                self._save()
            finally:
                self._mark("interrupted")
            raise
        except BaseException:
            self._mark("interrupted")
            raise

    def _fit_potential(self) -> None:
        """Let a script's value shape rewards; the first line of metrics says how well it fits."""
        potential, correlation = fitted_potential(self._run, self._env, self._check_interrupted)
        self._schedule.shape(potential)
        self._interval.add_losses({"potential_correlation": correlation})

    def _do(self, stage: Stage, total: int, step: Step) -> None:
        """Repeat ``step`` until ``total`` env-steps are done."""
        done, updates, began = 0, self._learner.updates, self._interval.seconds
        every = self._config.log_every_env_steps
        while done < total:
            self._check_interrupted()
            newest, metrics = step(done / total)
            before = self._env_steps
            self._env_steps += self._config.num_envs
            done += self._config.num_envs
            refuse_divergence({"losses": metrics or {}}, self._env_steps)
            self._interval.add_losses(metrics or {})
            self._attention.add(newest.obs, newest.actions)
            if done >= total or before // every < self._env_steps // every:
                self._log()
            if self._progress is not None:
                self._progress(
                    Progress(
                        env_steps=done,
                        total_env_steps=total,
                        updates=self._learner.updates - updates,
                        seconds=self._interval.seconds - began,
                        metrics=self._metrics,
                        stage=stage,
                    )
                )

    def _step(self, share: float) -> tuple[Transitions, dict[str, float] | None]:
        """Collect and learn, with ``share`` of the budget spent."""
        self._schedule.set_progress(share)
        transitions, truncated = self._collector.step()
        self._learner.observe(transitions, truncated)
        self._learner.set_progress(share)
        return transitions, self._learner.learn()

    def _log(self) -> None:
        self._metrics = self._interval.close(
            self._env_steps,
            self._learner.updates,
            self._collector.take_tally(),
            self._attention.entropy(self._learner),
        )
        self._file.append(self._metrics)
        self._mark("running")

    def _save(self) -> None:
        self._folder.save_weights(self._learner.state(), self._env_steps)

    def _mark(self, state: State) -> None:
        self._folder.mark(state, self._env_steps, self._learner.updates, self._interval.seconds)
