"""The stages of one training, step by step: imitate, then collect, learn and log; and save.

Everything can be saved between two control steps, and between two updates of one.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import replace

from torch import Tensor

from innerattn.errors import RunError
from innerattn.learn.compiled import CompilerError
from innerattn.learn.divergence import DivergenceError
from innerattn.learn.types import Transitions
from innerattn.records.logged import METRICS
from innerattn.records.run_folder import State
from innerattn.train.checkpoint import RunFolder
from innerattn.train.checkpoint_info import Best, CheckpointInfo, Counters, Stage
from innerattn.train.compilation import say_uncompiled
from innerattn.train.interruption import Interruptions
from innerattn.train.metrics import Metrics, MetricsFile, refuse_divergence
from innerattn.train.parts import Parts
from innerattn.train.potential import fitted_potential
from innerattn.train.progress import Progress
from innerattn.train.row_files import RowFiles
from innerattn.train.saved import Checkpoints, Content

_log = logging.getLogger(__name__)


class Stages:
    """One training, from where it is to its end."""

    def __init__(
        self,
        parts: Parts,
        folder: RunFolder,
        interruptions: Interruptions,
        progress: Callable[[Progress], None] | None,
        saved: CheckpointInfo | None = None,
    ) -> None:
        """Begin, or go on from a checkpoint that ``parts`` were loaded from."""
        self._parts, self._folder = parts, folder
        self._config = parts.config.train
        self._interruptions, self._progress = interruptions, progress
        self._checkpoints = Checkpoints(
            folder.path, parts.config.digest(), self._config.keep_checkpoints
        )
        self._file = MetricsFile(folder.path / METRICS)
        self._metrics: Metrics | None = None
        self._best_weights: Mapping[str, Tensor] | None = None
        first: Stage = "training" if parts.imitation is None else "imitating"
        self._at = Counters(stage=first) if saved is None else saved.counters
        if saved is not None:
            self._metrics = self._file.go_on_after(saved.metrics_bytes, saved.metrics_sha256)
        self._saved_at = time.monotonic()
        self._disk_is_full = self._is_told = False
        self._known_rows = {} if saved is None else saved.rows
        self._row_files: dict[str, RowFiles] = {}
        self._in_step = False

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
            if self._parts.resumable is not None:
                self._parts.resumable.interruptions = self._interruptions
            if self._config.potential != "none" and self._parts.schedule.potential is None:
                self._fit_potential()
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
            text = error.text(self._parts.env.robot_names)
            raise RunError(
                f"training diverged at env_steps = {self._at.env_steps}: {text}"
            ) from error
        except BaseException:
            self._give_up()
            raise

    def _give_up(self) -> None:
        with suppress(OSError):
            self._mark("interrupted")

    def _run_stages(self) -> None:
        if self._at.stage == "imitating":
            imitation = self._parts.imitation
            assert imitation is not None  # parts were built for this stage
            self._do(imitation.env_steps, imitation.collect, imitation.learn)
            self._at = replace(
                self._at,
                stage="training",
                stage_env_steps=0,
                stage_updates_before=self._parts.learner.updates,
                stage_seconds_before=self._parts.interval.seconds,
            )
            self._row_files = {}
        self._do(self._config.env_steps, self._collect, self._learn)

    def _fit_potential(self) -> None:
        """Let a script's value shape rewards; the first line of metrics says how well it fits."""
        parts = self._parts
        potential, correlation = fitted_potential(
            parts.config, parts.env, self._interruptions.check
        )
        parts.schedule.shape(potential)
        parts.interval.add_losses({"potential_correlation": correlation})

    def _do(
        self,
        total: int,
        collect: Callable[[float], tuple[Transitions, Mapping[str, float]]],
        learn: Callable[[float], Mapping[str, float]],
    ) -> None:
        """Repeat control steps and updates until ``total`` env-steps are done."""
        worlds = self._config.num_envs
        if not self._row_files:
            self._row_files = self._open_row_files()
        while self._at.learning or self._at.stage_env_steps < total:
            self._interruptions.check()
            if not self._at.learning:
                self._collect_step(collect, self._at.stage_env_steps / total)
            share = (self._at.stage_env_steps - worlds) / total
            try:
                metrics = learn(share)
            except CompilerError as error:
                say_uncompiled(f"the compiler fails ({error})")
                self._folder.info = replace(self._folder.info, compiled=False)
                metrics = learn(share)
            self._end_step({**self._at.step_metrics, **metrics}, total)
            self._report(total)
            if self._at.stage_env_steps < total and self._is_checkpoint_due():
                self._save_if_possible()

    def _collect_step(
        self,
        collect: Callable[[float], tuple[Transitions, Mapping[str, float]]],
        share: float,
    ) -> None:
        self._in_step = True
        newest, metrics = collect(share)
        self._parts.attention.add(newest.obs, newest.actions)
        self._at = replace(
            self._at,
            env_steps=self._at.env_steps + self._config.num_envs,
            stage_env_steps=self._at.stage_env_steps + self._config.num_envs,
            step_metrics=dict(metrics),
            learning=True,
        )
        self._in_step = False

    def _end_step(self, metrics: Mapping[str, float], total: int) -> None:
        now, every = self._at.env_steps, self._config.log_every_env_steps
        refuse_divergence({"losses": metrics}, now)
        self._parts.interval.add_losses(metrics)
        self._at = replace(self._at, learning=False, step_metrics={})
        crossed = (now - self._config.num_envs) // every < now // every
        if crossed or self._at.stage_env_steps >= total:
            self._log()
        if not self._disk_is_full:
            self._try("rows of the next checkpoint", self._write_whole_row_files)

    def _collect(self, share: float) -> tuple[Transitions, Mapping[str, float]]:
        self._parts.schedule.set_progress(share)
        transitions, truncated = self._parts.collector.step()
        self._parts.learner.observe(transitions, truncated)
        return transitions, {}

    def _learn(self, share: float) -> Mapping[str, float]:
        self._parts.schedule.set_progress(share)
        self._parts.learner.set_progress(share)
        return self._parts.learner.learn() or {}

    def _report(self, total: int) -> None:
        if self._progress is None:
            return
        at = self._at
        self._progress(
            Progress(
                env_steps=at.stage_env_steps,
                total_env_steps=total,
                updates=self._parts.learner.updates - at.stage_updates_before,
                seconds=self._parts.interval.seconds - at.stage_seconds_before,
                metrics=self._metrics,
                stage=at.stage,
            )
        )

    def _log(self) -> None:
        parts = self._parts
        before, tally = parts.interval.env_steps, parts.collector.take_tally()
        self._metrics = parts.interval.close(
            self._at.env_steps,
            parts.learner.updates,
            tally,
            parts.attention.entropy(parts.learner),
        )
        self._note_best(tally.all_rescues, self._at.env_steps - before)
        line = self._metrics
        self._try("a line of metrics", lambda: self._file.append(line))
        self._try("the state of the run", lambda: self._mark("running"))

    def _note_best(self, rescues: int, env_steps: int) -> None:
        """Compare rescues per env-step of all worlds, over as long as each world's episode takes.

        Rescues of the episodes that ended would favour early weights: where rescues end an episode,
        the lucky ones end first.
        """
        if not self._config.keep_best or self._at.stage != "training":
            return
        at = self._at
        rescues, env_steps = rescues + at.counted_rescues, env_steps + at.counted_env_steps
        if env_steps < self._config.num_envs * self._parts.env.scenario.episode_steps:
            self._at = replace(at, counted_rescues=rescues, counted_env_steps=env_steps)
            return
        best, rate = at.best, rescues / env_steps
        if best is None or rate >= best.rescues_per_env_step:
            best = Best(rate, at.env_steps)
            self._best_weights = self._parts.learner.state()
        self._at = replace(at, best=best, counted_rescues=0, counted_env_steps=0)

    def _is_checkpoint_due(self) -> bool:
        every, now = self._config.checkpoint_every_env_steps, self._at.env_steps
        if every and (now - self._config.num_envs) // every < now // every:
            return True
        minutes = self._config.checkpoint_every_minutes
        return bool(minutes) and time.monotonic() - self._saved_at >= 60.0 * minutes

    def _save_if_possible(self) -> None:
        self._disk_is_full = False
        what = f"the checkpoint at {self._at.env_steps:,} env-steps"
        self._try(what, self._save)
        self._is_told = self._disk_is_full
        self._saved_at = time.monotonic()

    def _save(self) -> None:
        """Save everything that the run needs to go on, or the weights if it cannot go on."""
        weights = self._parts.learner.state()
        if self._parts.resumable is None:
            self._folder.save_weights(weights, self._at.env_steps)
            return
        self._at = replace(self._at, seconds=self._parts.interval.seconds)
        if not self._row_files:
            self._row_files = self._open_row_files()
        state = self._parts.resume_state(self._at.stage)
        files = self._row_files
        content = Content(self._at, weights, state, files, self._file, self._best_weights)
        self._folder.save_checkpoint(self._checkpoints, content)
        self._best_weights = None

    def _save_what_is_there(self) -> None:
        """Save a run that was interrupted; if that fails, the newest checkpoint is an older one."""
        try:
            if not self._in_step:
                self._try("what was learnt last", self._save)
        finally:
            self._try("the state of the run", lambda: self._mark("interrupted"))

    def _finish(self) -> None:
        """Save what the run came to, and remove what it needed on the way."""
        now, best = self._at.env_steps, self._at.best
        self._file.sync()
        self._folder.save_weights(self._parts.learner.state(), now)
        self._checkpoints.save_best(best, self._best_weights)
        self._mark("done")
        self._checkpoints.keep_last_weights_only(now, best)
        self._mark("done")

    def _open_row_files(self) -> dict[str, RowFiles]:
        folder = self._checkpoints.rows
        rings = self._parts.rings(self._at.stage)
        if rings:
            folder.mkdir(exist_ok=True)
        known, self._known_rows = self._known_rows, {}
        return {name: RowFiles(folder, name, ring, known.get(name)) for name, ring in rings.items()}

    def _write_whole_row_files(self) -> None:
        for files in self._row_files.values():
            files.write_whole_files()

    def _try(self, what: str, write: Callable[[], None]) -> None:
        """Write something that can be written later as well; a full disk may have space again."""
        try:
            write()
        except OSError as error:
            self._disk_is_full = True
            if not self._is_told:  # once, until something is saved again
                self._is_told = True
                where = error.filename or self._folder.path
                text = "innerattn: warning: %s: cannot be written (%s); %s is not saved for now"
                _log.warning(text, where, error.strerror, what)

    def _mark(self, state: State) -> None:
        parts = self._parts
        self._folder.mark(state, self._at.env_steps, parts.learner.updates, parts.interval.seconds)
