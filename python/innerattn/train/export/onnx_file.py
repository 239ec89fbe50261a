"""One actor as the bytes of an ONNX file; nothing of the machine that made it is in there."""

from __future__ import annotations

import logging
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import torch

from innerattn.policies.exported.backend import INPUT, MARK
from innerattn.train.export.actors import OnnxForm


def onnx_bytes(form: OnnxForm, width: int, mark: str) -> bytes:
    """The ONNX file of one actor, for any number of observations at once.

    Args:
        form: the actor.
        width: D.
        mark: what the file says of itself, as of `innerattn.policies.exported.backend.onnx_mark`.
    """
    rows = torch.zeros(2, width)
    with _quiet():
        program = torch.onnx.export(
            form.eval(),
            (rows,),
            dynamo=True,
            external_data=False,
            input_names=[INPUT],
            output_names=[*form.names],
            dynamic_shapes=({0: torch.export.Dim("batch", min=1)},),
            verbose=False,
        )
    assert program is not None  # as no file was asked for
    model = program.model_proto
    _forget(model)
    entry = model.metadata_props.add()
    entry.key, entry.value = MARK, mark
    data: bytes = model.SerializeToString(deterministic=True)
    return data


def _forget(model: Any) -> None:
    """Drop what the exporter notes about files and lines of the program."""
    graph = model.graph
    for part in (model, graph, *graph.node, *graph.initializer, *graph.value_info):
        del part.metadata_props[:]
        part.doc_string = ""
    for part in (*graph.input, *graph.output):
        del part.metadata_props[:]
        part.doc_string = ""


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep to itself what the exporter says about operators and versions that are not in use."""
    log = logging.getLogger("torch.onnx")
    before = log.level
    log.setLevel(logging.ERROR)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        log.setLevel(before)
