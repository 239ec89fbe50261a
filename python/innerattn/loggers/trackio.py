"""trackio; its own settings say where to, such as ``TRACKIO_DIR``."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import trackio

from innerattn.loggers.logger import Ending, Opened

if TYPE_CHECKING:
    from trackio.run import Run

PROJECT = "innerattn"


def open_trackio(run: Opened) -> TrackioLogger:
    """A logger with a trackio run of its own."""
    begun = trackio.init(
        PROJECT,
        name=run.name,
        config=run.parameters,
        embed=False,
        auto_log_gpu=False,
        auto_log_cpu=False,
    )
    return TrackioLogger(begun)


class TrackioLogger:
    """Sends numbers by env-steps."""

    def __init__(self, run: Run) -> None:
        self._run: Any = run  # its methods have no types

    def log(self, env_steps: int, values: Mapping[str, float]) -> None:
        """Send the numbers."""
        self._run.log(dict(values), step=env_steps)

    def close(self, _ending: Ending, /) -> None:
        """Send what is left."""
        self._run.finish()
