"""What a logger is, which ones there are, and the values that they get."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any, Literal, Protocol

from innerattn.config import RunConfig
from innerattn.errors import InnerattnError, MissingLibraryError, one_line

Ending = Literal["done", "interrupted", "failed"]


@dataclass(frozen=True)
class Opened:
    """What a logger is opened for.

    Attributes:
        folder: the run folder; training makes it before the first metrics come.
        config: what is trained.
    """

    folder: Path
    config: RunConfig

    @property
    def name(self) -> str:
        """The run's name, that of its folder."""
        return self.folder.name

    @property
    def parameters(self) -> dict[str, Any]:
        """The values that the run depends on, by dotted key, with its digest."""
        flat = {
            f"{section}.{key}": value
            for section, values in self.config.in_use().items()
            for key, value in values.items()
        }
        return {**flat, "config_sha256": self.config.digest()}


class MetricsLogger(Protocol):
    """Sends numbers somewhere."""

    def log(self, env_steps: int, values: Mapping[str, float]) -> None:
        """Send the numbers of one time; names have parts between slashes."""

    def close(self, ending: Ending, /) -> None:
        """Send what is left and let go of everything; called once."""


LOGGERS: Mapping[str, tuple[str, str]] = {
    "tensorboard": ("innerattn.loggers.tensorboard:open_tensorboard", "tensorboard"),
    "wandb": ("innerattn.loggers.wandb:open_wandb", "wandb"),
    "mlflow": ("innerattn.loggers.mlflow:open_mlflow", "mlflow"),
    "trackio": ("innerattn.loggers.trackio:open_trackio", "trackio"),
}
"""By name, what opens a logger for `Opened`, as "module:function", and the package it needs."""


def open_logger(name: str, run: Opened) -> MetricsLogger:
    """The logger of a name of `LOGGERS`, ready.

    Raises:
        MissingLibraryError: its package is not installed.
        InnerattnError: its package cannot begin; the message says why.
    """
    place, package = LOGGERS[name]
    try:
        import_module(package)
    except ImportError as error:
        raise MissingLibraryError(
            f"--log {name} needs {package}: pip install 'innerattn[log]'"
        ) from error
    module, _, function = place.partition(":")
    try:
        opened: MetricsLogger = getattr(import_module(module), function)(run)
    except Exception as error:
        raise InnerattnError(f"--log {name}: {one_line(error)}") from error
    return opened


def values_of(metrics: Mapping[str, Any]) -> dict[str, float]:
    """The numbers of a line of metrics, by name; lists are numbered, None is left out.

    ``{"losses": {"critic": 1.0}, "attention_entropy": {"food_0": [0.5]}}`` gives ``losses/critic``
    and ``attention_entropy/food_0/0``.
    """
    return dict(_flat("", metrics))


def _flat(name: str, value: Any) -> Iterator[tuple[str, float]]:
    if isinstance(value, Mapping):
        parts = list(value.items())
    elif isinstance(value, list):
        parts = [(str(i), one) for i, one in enumerate(value)]
    else:
        if value is not None:
            yield name, float(value)
        return
    for key, one in parts:
        yield from _flat(f"{name}/{key}" if name else key, one)
