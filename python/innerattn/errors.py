"""Exceptions that a user of innerattn can catch; each message is one line."""

from __future__ import annotations

import errno
from collections.abc import Sequence


def plain(text: str) -> str:
    """A text without characters that a terminal obeys or that nobody sees; they are escaped.

    Names of files and keys, and what files hold, may come from anybody: ESC moves the cursor, and
    U+202E turns the direction of writing. Line ends and tabs stay.
    """
    if text.isprintable():
        return text
    return "".join(
        one if one.isprintable() or one in "\n\t" else one.encode("unicode_escape").decode("ascii")
        for one in text
    )


def one_line(error: BaseException) -> str:
    """What an error says, in one plain line; of one that lacked memory, first of all that."""
    while _wraps_its_reason(error):
        error = error.__cause__  # type: ignore[assignment]
    text = _of_system(error) if isinstance(error, OSError) else str(error)
    text = plain(" ".join(text.split()))
    if lacked_memory(error):
        return f"out of memory: {text}" if text else "out of memory"
    return text


def _wraps_its_reason(error: BaseException) -> bool:
    """Whether a library could not be imported and tells a page of advice, as NumPy does."""
    foreign = isinstance(error, ImportError) and not isinstance(error, InnerattnError)
    return foreign and isinstance(error.__cause__, ImportError)


def _of_system(error: OSError) -> str:
    """The files that a system call failed for, and why."""
    names = [str(name) for name in (error.filename, error.filename2) if name is not None]
    if error.strerror is None:
        return str(error)
    return ": ".join([" -> ".join(names), error.strerror] if names else [error.strerror])


def lacked_memory(error: BaseException) -> bool:
    """Whether memory was lacking: also in PyTorch, and while a library was loaded.

    Code in C that cannot even make a MemoryError leaves a SystemError "without exception set".
    """
    if isinstance(error, SystemError):
        return "without exception set" in str(error)
    if isinstance(error, (RuntimeError, ImportError)):
        signs = (
            "can't allocate memory",
            "cannot allocate memory",
            "out of memory",
            "failed to map",
        )
        return any(sign in str(error).lower() for sign in signs)
    if isinstance(error, OSError):
        return error.errno == errno.ENOMEM
    return isinstance(error, MemoryError)


class InnerattnError(Exception):
    """Base of all errors that innerattn raises on purpose."""


def needs_no_traceback(error: Exception) -> bool:
    """Whether one line says all about an error: ours, a file's, or a lack of memory."""
    return isinstance(error, (InnerattnError, OSError)) or lacked_memory(error)


class ConfigError(InnerattnError, ValueError):
    """A configuration, preset or scenario is not valid; the message names the key."""


class ScheduleError(InnerattnError, ValueError):
    """A schedule does not serve the tasks of its instance, or its robots wait for ever."""


class RunError(InnerattnError):
    """A run folder is missing, foreign, damaged, or already there."""


class ExportError(InnerattnError):
    """The folder of an exported team is missing, damaged, already there, or cannot be made."""


class ReadingError(InnerattnError, ValueError):
    """A robot's readings are not what its policy can act on."""

    def __init__(self, field: str, reason: str) -> None:
        super().__init__(f"{field}: {reason}")
        self.field = field
        """What is wrong, such as ``teammates.food_1.position``."""


class StaleReadingError(ReadingError):
    """A reading is older, or further in the future, than is allowed."""


EXTRA_OF = {
    "gymnasium": "gym",
    "imageio_ffmpeg": "report",
    "matplotlib": "report",
    "onnx": "deploy",
    "onnxruntime": "deploy",
    "onnxscript": "deploy",
    "optuna": "search",
    "PIL": "maps",
    "pettingzoo": "gym",
    "ray": "ray",
    "safetensors": "train",
    "tensordict": "torchrl",
    "torch": "train",
    "torchrl": "torchrl",
    "yaml": "maps",
}
"""The extra of this package that brings a library, by the library's module."""


_REQUIRED = frozenset({"numpy", "pyarrow", "pydantic", "rich", "scipy", "tomli_w", "tyro"})
"""Modules that come with the package, unless somebody took them away."""


class MissingLibraryError(InnerattnError, ImportError):
    """A library that is no dependency is not installed; the message says how to install it."""


def missing_library(
    what: str, error: ModuleNotFoundError, extra: str = ""
) -> MissingLibraryError | None:
    """The error that says which extra brings a module that was not found; none for other modules.

    Args:
        what: who needs it.
        error: what Python raised.
        extra: the extra to install; none: the one that brings the module.
    """
    library = (error.name or "").partition(".")[0]
    if library in _REQUIRED:
        return MissingLibraryError(f"{what} needs {library}: pip install {library}")
    if library not in EXTRA_OF:
        return None
    extra = extra or EXTRA_OF[library]
    return MissingLibraryError(f"{what} needs {library}: pip install 'innerattn[{extra}]'")


def cannot_lock(error: OSError) -> bool:
    """Whether an attempt to lock failed because the file system has no locks, as NFS without lockd.

    Then nothing keeps others out, as on Windows.
    """
    return error.errno in (
        errno.ENOLCK,
        errno.ENOSYS,
        errno.EINVAL,
        errno.EOPNOTSUPP,
        errno.EPERM,
    )


class UnsealedRunWarning(UserWarning):
    """A run was read that has no manifest: nothing tells whether its files are what they were."""


class WorldError(InnerattnError, RuntimeError):
    """Worlds failed inside compiled code; all others have done the step.

    Those named wait at the start of their episodes for a reset: `env.reset(mask=...)`.
    """

    def __init__(self, message: str, envs: Sequence[int] = ()) -> None:
        super().__init__(message)
        self.envs = tuple(envs)
        """Indices of the worlds in the batch, in order."""
