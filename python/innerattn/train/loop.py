"""The training loop: collect, learn, log, until the budget is spent; then save and stop.

It knows no algorithm, only the `Learner` protocol, and does not evaluate.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

import torch

from innerattn.config import RunConfig
from innerattn.envs import BatchEnv
from innerattn.learn.types import Learner, Transitions
from innerattn.train.build import (
    build_learner,
    keep_heap_small,
    thread_count,
    torch_threads,
)
from innerattn.train.checkpoint import RunFolder, State, refuse_existing
from innerattn.train.collect import Collector
from innerattn.train.compilation import compiles
from innerattn.train.metrics import (
    Interval,
    Metrics,
    MetricsFile,
    attention_entropy,
    refuse_divergence,
)
from innerattn.train.products import best_products


@dataclass(frozen=True)
class Progress:
    """How far training is; reported after every control step."""

    env_steps: int
    """Steps done, all worlds counted."""
    total_env_steps: int
    """Steps to do."""
    updates: int
    """Updates done."""
    seconds: float
    """Time since training began [s]."""
    metrics: Metrics | None
    """The newest line of metrics, if there is one yet."""


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
    with torch_threads(threads), best_products() as products:
        env = BatchEnv(
            config.scenario,
            config.train.num_envs,
            seed=config.train.seed,
            num_threads=config.train.threads,
        )
        with closing(env):
            learner = build_learner(config, env)
            collector = Collector(env, learner, torch.device(config.train.device))
            compiled = compiles(config)
            if compiled:
                learner.compile()
            folder = RunFolder.create(path, config, threads, compiled, products)
            _Loop(config, folder, learner, collector, env.robot_names, progress).run()
    return path


class _Loop:
    """The state of one training run."""

    def __init__(
        self,
        config: RunConfig,
        folder: RunFolder,
        learner: Learner,
        collector: Collector,
        robot_names: tuple[str, ...],
        progress: Callable[[Progress], None] | None,
    ) -> None:
        self._config = config.train
        self._folder = folder
        self._learner = learner
        self._collector = collector
        self._robot_names = robot_names
        self._progress = progress
        self._file = MetricsFile(folder.path / "metrics.jsonl")
        self._interval = Interval()
        self._metrics: Metrics | None = None
        self._env_steps = 0

    def run(self) -> None:
        """Run to the end of the budget.

        Whatever ends the run early is written down; only what a user interrupts is worth keeping
        the weights of.
        """
        try:
            while self._env_steps < self._config.env_steps:
                self._step()
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

    def _step(self) -> None:
        transitions, truncated = self._collector.step()
        self._learner.observe(transitions, truncated)
        self._learner.reach(min(self._env_steps / self._config.env_steps, 1.0))
        losses = self._learner.learn() or {}
        before = self._env_steps
        self._env_steps += self._config.num_envs
        refuse_divergence({"losses": losses}, self._env_steps)
        self._interval.add_losses(losses)
        every = self._config.log_every_env_steps
        last = self._env_steps >= self._config.env_steps
        if last or before // every < self._env_steps // every:
            self._log(transitions)
        if self._progress is not None:
            self._progress(
                Progress(
                    env_steps=self._env_steps,
                    total_env_steps=self._config.env_steps,
                    updates=self._learner.updates,
                    seconds=self._interval.seconds,
                    metrics=self._metrics,
                )
            )

    def _log(self, newest: Transitions) -> None:
        weights = self._learner.attention(newest.obs, newest.actions)
        entropy: dict[str, list[float]] = {}
        if weights is not None:
            rows = attention_entropy(weights.cpu().numpy()).tolist()
            entropy = dict(zip(self._robot_names, rows, strict=True))
        self._metrics = self._interval.close(
            self._env_steps,
            self._learner.updates,
            self._collector.take_tally(),
            entropy,
        )
        self._file.append(self._metrics)
        self._mark("running")

    def _save(self) -> None:
        self._folder.save_weights(self._learner.state(), self._env_steps)

    def _mark(self, state: State) -> None:
        self._folder.mark(state, self._env_steps, self._learner.updates, self._interval.seconds)
