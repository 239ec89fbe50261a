"""The stages of one training, step by step: imitate, then collect and learn.

Everything can be saved between two control steps, and between two updates of one. What is written
down of it is in `innerattn.train.recorded`.
"""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import replace

import torch

from innerattn.errors import RunError
from innerattn.learn import workers
from innerattn.learn.compiled import CompilerError
from innerattn.learn.divergence import DivergenceError
from innerattn.train.checkpoint_info import Counters, Stage
from innerattn.train.interruption import Interruptions
from innerattn.train.metrics import refuse_divergence
from innerattn.train.training import Training

_CLOCK_EVERY = 8
"""Control steps after which several workers look at the clock of the first one."""


class Stages(ABC):
    """One training, from where it is to its end; of several workers, the part that one does."""

    def __init__(
        self, parts: Training, interruptions: Interruptions, counters: Counters | None
    ) -> None:
        """Begin, or go on from the counters of a checkpoint that ``parts`` were loaded from."""
        self._parts, self._config = parts, parts.config.train
        self._interruptions = interruptions
        first: Stage = "training" if parts.imitation_env_steps is None else "imitating"
        self._at = Counters(stage=first) if counters is None else counters
        self._saved_at = time.monotonic()
        self._in_step = False

    @abstractmethod
    def _open_rows(self) -> None:
        """Prepare to write what is new in the large memories of the stage."""

    @abstractmethod
    def _write_whole_row_files(self) -> None:
        """Write what is new in them, as far as it fills a file."""

    @abstractmethod
    def _log(self) -> None:
        """Note what happened since the last call."""

    @abstractmethod
    def _save_if_possible(self) -> None:
        """Save everything that the run needs to go on; what cannot be written now can be later."""

    @abstractmethod
    def _save_what_is_there(self) -> None:
        """Save a run that was interrupted; if that fails, the newest checkpoint is an older one."""

    @abstractmethod
    def _finish(self) -> None:
        """Save what the run came to."""

    @abstractmethod
    def _give_up(self) -> None:
        """Note that the run was interrupted; what was saved before stays."""

    @abstractmethod
    def _say_uncompiled(self, why: str) -> None:
        """Note that updates are no longer compiled."""

    @abstractmethod
    def _report(self, total: int) -> None:
        """Say how far the stage is."""

    def run(self) -> None:
        """Go on to the end of the budget.

        A run that ends early is marked as interrupted. It is saved where the user interrupted it;
        after an error, the newest checkpoint is the last good one.

        Raises:
            RunError: training diverged; the message names step, tensor and robot.
            OSError: the run is at its end, and cannot be saved.
            KeyboardInterrupt: after the run is saved, unless somebody asked twice.
        """
        try:
            workers.total(torch.zeros(1))  # the folder is there before anybody writes to it
            self._parts.begin(self._interruptions)
            with self._interruptions.deferred():
                self._run_stages()
                self._finish()
        except KeyboardInterrupt:
            if not self._interruptions.urgent:
                with self._interruptions.deferred():
                    self._save_what_is_there()
            raise
        except DivergenceError as error:
            self._give_up()
            text = error.text(self._parts.robot_names)
            raise RunError(
                f"training diverged at env_steps = {self._at.env_steps}: {text}"
            ) from error
        except BaseException:
            self._give_up()
            raise

    def _run_stages(self) -> None:
        if self._at.stage == "imitating":
            total = self._parts.imitation_env_steps
            assert total is not None  # parts were built for this stage
            self._do(total, self._parts.imitate, self._parts.learn_imitating)
            self._at = replace(
                self._at,
                stage="training",
                stage_env_steps=0,
                stage_updates_before=self._parts.updates,
                stage_seconds_before=self._parts.interval.seconds,
            )
        self._do(self._config.env_steps, self._parts.collect, self._parts.learn)

    def _do(
        self,
        total: int,
        collect: Callable[[float], Mapping[str, float]],
        learn: Callable[[float], Mapping[str, float]],
    ) -> None:
        """Repeat control steps and updates until ``total`` env-steps are done."""
        at_once = self._parts.env_steps_at_once
        self._open_rows()
        while self._at.learning or self._at.stage_env_steps < total:
            self._interruptions.check()
            if not self._at.learning:
                self._collect_step(collect, self._at.stage_env_steps / total)
            share = (self._at.stage_env_steps - at_once) / total
            try:
                metrics = learn(share)
            except CompilerError as error:
                self._say_uncompiled(f"the compiler fails ({error})")
                metrics = learn(share)
            self._end_step({**self._at.step_metrics, **metrics}, total)
            self._report(total)
            if self._at.stage_env_steps < total and self._is_checkpoint_due():
                self._save_if_possible()
                self._saved_at = time.monotonic()

    def _collect_step(
        self,
        collect: Callable[[float], Mapping[str, float]],
        share: float,
    ) -> None:
        self._in_step = True
        metrics = collect(share)
        at_once = self._parts.env_steps_at_once
        self._at = replace(
            self._at,
            env_steps=self._at.env_steps + at_once,
            stage_env_steps=self._at.stage_env_steps + at_once,
            step_metrics=dict(metrics),
            learning=True,
        )
        self._in_step = False

    def _end_step(self, metrics: Mapping[str, float], total: int) -> None:
        now, every = self._at.env_steps, self._config.log_every_env_steps
        refuse_divergence({"losses": metrics}, now)
        self._parts.interval.add_losses(metrics)
        self._at = replace(self._at, learning=False, step_metrics={})
        crossed = (now - self._parts.env_steps_at_once) // every < now // every
        if crossed or self._at.stage_env_steps >= total:
            self._log()
        self._write_whole_row_files()

    def _is_checkpoint_due(self) -> bool:
        every, now = self._config.checkpoint_every_env_steps, self._at.env_steps
        at_once = self._parts.env_steps_at_once
        if every and (now - at_once) // every < now // every:
            return True
        minutes = self._config.checkpoint_every_minutes
        if not minutes or (workers.count() > 1 and now // at_once % _CLOCK_EVERY):
            return False
        due = time.monotonic() - self._saved_at >= 60.0 * minutes
        return bool(workers.of_first(torch.tensor(due)))
