"""A training that leaves a run folder: what is written of its stages, and when."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import replace

import torch
from torch import Tensor

from innerattn.learn import workers
from innerattn.records.logged import METRICS
from innerattn.records.run_folder import State
from innerattn.train.checkpoint import RunFolder
from innerattn.train.checkpoint_info import Best, CheckpointInfo
from innerattn.train.compilation import say_uncompiled
from innerattn.train.interruption import Interruptions
from innerattn.train.metrics import Metrics, MetricsFile
from innerattn.train.progress import Progress
from innerattn.train.row_files import RowsOnDisk
from innerattn.train.saved import Checkpoints, Content
from innerattn.train.stages import Stages
from innerattn.train.training import Training
from innerattn.train.workers.states import own_part, rows_of_others, state_of_all

_log = logging.getLogger(__name__)


class RecordedStages(Stages):
    """One training, with all that it writes; of several workers, the first one's part."""

    def __init__(
        self,
        parts: Training,
        folder: RunFolder,
        interruptions: Interruptions,
        progress: Callable[[Progress], None] | None,
        saved: CheckpointInfo | None = None,
    ) -> None:
        """Begin, or go on from a checkpoint that ``parts`` were loaded from."""
        super().__init__(parts, interruptions, None if saved is None else saved.counters)
        self._folder, self._progress = folder, progress
        self._checkpoints = Checkpoints(
            folder.path, parts.config.digest(), self._config.keep_checkpoints
        )
        self._file = MetricsFile(folder.path / METRICS)
        self._metrics: Metrics | None = None
        self._best_weights: Mapping[str, Tensor] | None = None
        if saved is not None:
            self._metrics = self._file.go_on_after(saved.metrics_bytes, saved.metrics_sha256)
        self._disk_is_full = self._is_told = False
        self._rows = RowsOnDisk(
            self._checkpoints.rows, {} if saved is None else own_part(saved.rows)
        )

    def _give_up(self) -> None:
        with suppress(OSError):
            self._mark("interrupted")

    def _say_uncompiled(self, why: str) -> None:
        say_uncompiled(why)
        self._folder.info = replace(self._folder.info, compiled=False)

    def _report(self, total: int) -> None:
        if self._progress is None:
            return
        at = self._at
        now = Progress(
            env_steps=at.stage_env_steps,
            total_env_steps=total,
            updates=self._parts.updates - at.stage_updates_before,
            seconds=self._parts.interval.seconds - at.stage_seconds_before,
            metrics=self._metrics,
            stage=at.stage,
        )
        try:
            self._progress(now)
        except KeyboardInterrupt as error:
            self._interruptions.take(error)

    def _log(self) -> None:
        parts = self._parts
        before, tally = parts.interval.env_steps, parts.take_tally()
        self._metrics = parts.interval.close(
            self._at.env_steps,
            parts.updates,
            tally,
            parts.attention_entropy(),
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
        if env_steps < self._config.num_envs * self._parts.config.training_scenario.episode_steps:
            self._at = replace(at, counted_rescues=rescues, counted_env_steps=env_steps)
            return
        best, rate = at.best, rescues / env_steps
        if best is None or rate >= best.rescues_per_env_step:
            best = Best(rate, at.env_steps)
            self._best_weights = self._parts.weights()
        self._at = replace(at, best=best, counted_rescues=0, counted_env_steps=0)

    def _save_if_possible(self) -> None:
        self._disk_is_full = False
        what = f"the checkpoint at {self._at.env_steps:,} env-steps"
        self._try(what, self._save)
        self._is_told = self._disk_is_full

    def _save(self) -> None:
        """Save everything that the run needs to go on, or the weights if it cannot go on."""
        weights = self._parts.weights()
        if not self._parts.can_resume:
            self._folder.save_weights(weights, self._at.env_steps)
            return
        self._at = replace(self._at, seconds=self._parts.interval.seconds)
        stage = self._at.stage
        others = rows_of_others(dict)
        state = state_of_all(self._parts.resume_state(stage))
        try:
            rows = self._rows.write(self._parts.rings(stage)) | others
            content = Content(self._at, weights, state, rows, self._file, self._best_weights)
            self._folder.save_checkpoint(self._checkpoints, content)
            self._best_weights = None
        finally:
            workers.total(torch.zeros(1))  # until here nobody writes rows that nothing names yet

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
        self._folder.save_weights(self._parts.weights(), now)
        self._checkpoints.save_best(best, self._best_weights)
        self._mark("done")
        self._checkpoints.keep_last_weights_only(now, best)
        self._mark("done")

    def _open_rows(self) -> None:
        self._rows.open(self._parts.rings(self._at.stage))

    def _write_whole_row_files(self) -> None:
        if not self._disk_is_full:
            self._try("rows of the next checkpoint", self._rows.write_whole_files)

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
        times = parts.interval.seconds, parts.interval.cpu_seconds
        self._folder.mark(state, self._at.env_steps, parts.updates, *times)
