"""What computes a policy: numpy, or onnxruntime on one thread."""

from __future__ import annotations

from importlib.util import find_spec
from typing import Any, Literal, Protocol, get_args

import numpy as np
from numpy.typing import NDArray

from innerattn.errors import ExportError, MissingLibraryError
from innerattn.policies.exported.contract import Contract

Backend = Literal["onnxruntime", "numpy"]
INPUT, LOGITS, PROBABILITIES = "observation", "logits", "probabilities"
"""Names of the input and the outputs of an ONNX file."""
POLICY, FORCE = "policy", "force"
"""Names of the outputs where actions are continuous; the second is tanh of the means."""


class Actor(Protocol):
    """A robot's policy."""

    def logits(self, rows: NDArray[np.float32]) -> NDArray[np.float32]:
        """Map observations (B, D) float32 to outputs (B, O) float32 for the world's actions.

        See `Contract.outputs`.
        """


class OnnxActor:
    """An ONNX file in onnxruntime."""

    def __init__(self, data: bytes, name: str, contract: Contract, mark: str) -> None:
        """Load a file.

        Args:
            data: the file.
            name: what to call it in messages.
            contract: of the team.
            mark: what the file must say of itself, as of `onnx_mark`.

        Raises:
            ExportError: the file cannot be loaded, or belongs to another team.
            MissingLibraryError: onnxruntime is not installed.
        """
        width, outputs = len(contract.observation), contract.outputs
        if contract.action_kind == "continuous":
            self._output, expected = POLICY, [[INPUT, width], [POLICY, outputs], [FORCE, 2]]
        else:
            self._output = LOGITS
            expected = [[INPUT, width], [LOGITS, outputs], [PROBABILITIES, outputs]]
        self._session = onnx_session(data, name, mark, expected)

    def logits(self, rows: NDArray[np.float32]) -> NDArray[np.float32]:
        """See `Actor.logits`."""
        (found,) = self._session.run([self._output], {INPUT: rows})
        return np.asarray(found)


def onnx_session(data: bytes, name: str, mark: str, expected: list[list[Any]]) -> Any:
    """Load an ONNX file into onnxruntime, on one thread.

    Args:
        data: the file.
        name: what to call it in messages.
        mark: what it must say of itself, as of `onnx_mark`.
        expected: its inputs and outputs: the name of each, and its sizes but for the first.

    Raises:
        ExportError: the file cannot be loaded, or belongs to another team.
        MissingLibraryError: onnxruntime is not installed.
    """
    runtime = _onnxruntime()
    options = runtime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.log_severity_level = 4
    try:
        session = runtime.InferenceSession(data, options, providers=["CPUExecutionProvider"])
    except Exception as error:  # onnxruntime has no common base of its errors
        raise ExportError(f"{name}: onnxruntime cannot load it ({_first_line(error)})") from error
    said = session.get_modelmeta().custom_metadata_map.get(MARK)
    if said != mark:
        raise ExportError(f"{name}: is not of this team and robot: it says {said!r}")
    found = [[one.name, *one.shape[1:]] for one in (*session.get_inputs(), *session.get_outputs())]
    if found != expected:
        raise ExportError(f"{name}: has {found}, must have {expected}")
    return session


MARK = "innerattn.actor"
"""Key of the mark in an ONNX file's metadata."""


def onnx_mark(weights_sha256: str, scenario_sha256: str, actor: str) -> str:
    """What an ONNX file says of itself: of which weights, worlds and actor it is."""
    return f"{weights_sha256} {scenario_sha256} {actor}"


def chosen_backend(backend: str | None) -> Backend:
    """The backend asked for; onnxruntime where it is installed if none is.

    Raises:
        ValueError: there is no such backend.
        MissingLibraryError: onnxruntime is asked for and not installed.
    """
    if backend is None:
        return "onnxruntime" if find_spec("onnxruntime") is not None else "numpy"
    if backend not in get_args(Backend):
        known = " or ".join(repr(one) for one in get_args(Backend))
        raise ValueError(f"backend = {backend!r}: must be {known}, or None for what is installed")
    if backend == "onnxruntime":
        _onnxruntime()
        return "onnxruntime"
    return "numpy"


def _onnxruntime() -> Any:
    try:
        import onnxruntime

        return onnxruntime
    except ModuleNotFoundError as error:
        if error.name != "onnxruntime":
            raise
        text = "backend = 'onnxruntime' needs onnxruntime: pip install onnxruntime"
        raise MissingLibraryError(text) from error


def _first_line(error: Exception) -> str:
    return str(error).strip().split("\n")[0]
