"""The loggers of one training: they follow its progress, and never end it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from types import TracebackType
from typing import Any, Protocol, Self

from innerattn.errors import one_line
from innerattn.loggers.logger import Ending, MetricsLogger, Opened, open_logger, values_of
from innerattn.measures.summary import Summary


class Reported(Protocol):
    """What of `innerattn.train.Progress` a logger looks at."""

    @property
    def metrics(self) -> Mapping[str, Any] | None:
        """The newest line of metrics, if there is one yet."""


class RunLoggers:
    """Sends every new line of metrics to some loggers.

    A logger that fails while training goes on is left out from then on, and said once.
    """

    def __init__(
        self, names: Sequence[str], run: Opened, failed: Callable[[str], None] = lambda _: None
    ) -> None:
        """Open the loggers.

        Args:
            names: keys of `innerattn.loggers.LOGGERS`.
            run: what is trained.
            failed: told in one line which logger failed, and why.

        Raises:
            InnerattnError: a package is not installed, or cannot begin; those opened before are
                closed.
        """
        self._failed = failed
        self._open: dict[str, MetricsLogger] = {}
        self._newest: Mapping[str, Any] | None = None
        self._env_steps = 0
        try:
            for name in dict.fromkeys(names):
                self._open[name] = open_logger(name, run)
        except BaseException:
            self._each(lambda logger: logger.close("failed"))
            raise

    def __call__(self, progress: Reported) -> None:
        """Send the newest line of metrics, unless it was sent before."""
        metrics = progress.metrics
        if metrics is not None and metrics is not self._newest:
            self._newest = metrics
            self._env_steps = int(metrics["env_steps"])
            self._log({name: value for name, value in metrics.items() if name != "env_steps"})

    def log_scores(self, summary: Summary) -> None:
        """Send what the evaluation at the end found."""
        found = {
            f"evaluation/{name}": {
                "rescues_per_episode": part.rescues_per_episode.mean,
                "score": None if part.score is None else part.score.mean,
            }
            for name, part in (("standard", summary.standard), ("long", summary.long))
        }
        self._log(found)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        ending: Ending = "done"
        if kind is not None:
            ending = "interrupted" if issubclass(kind, KeyboardInterrupt) else "failed"
        self._each(lambda logger: logger.close(ending))
        self._open = {}

    def _log(self, metrics: Mapping[str, Any]) -> None:
        values = values_of(metrics)
        self._each(lambda logger: logger.log(self._env_steps, values))

    def _each(self, do: Callable[[MetricsLogger], None]) -> None:
        for name, logger in list(self._open.items()):
            try:
                do(logger)
            except Exception as error:  # whatever a library raises: training goes on
                del self._open[name]
                self._failed(f"{name}: {one_line(error) or type(error).__name__}")
