"""TensorBoard event files in the run folder."""

from __future__ import annotations

from collections.abc import Mapping

from torch.utils.tensorboard import SummaryWriter

from innerattn.loggers.logger import Ending, Opened
from innerattn.records.run_files import amend

FOLDER = "tensorboard"
"""In the run folder."""


def open_tensorboard(run: Opened) -> TensorBoardLogger:
    """A logger whose files begin with the first metrics, once the run folder is there."""
    return TensorBoardLogger(run)


class TensorBoardLogger:
    """Writes scalars by env-steps, and the parameters as text."""

    def __init__(self, run: Opened) -> None:
        self._run = run
        self._writer: SummaryWriter | None = None

    def log(self, env_steps: int, values: Mapping[str, float]) -> None:
        """Write scalars; the file is whole after each call."""
        if self._writer is None:
            self._writer = SummaryWriter(str(self._run.folder / FOLDER))
            lines = [f"    {key} = {value!r}" for key, value in self._run.parameters.items()]
            self._writer.add_text("parameters", "\n".join(lines), env_steps)
        for name, value in values.items():
            self._writer.add_scalar(name, value, env_steps)
        self._writer.flush()

    def close(self, _ending: Ending, /) -> None:
        """Close the file, and enter it in the run's manifest."""
        if self._writer is not None:
            self._writer.close()
            amend(self._run.folder, FOLDER)
