"""Actors as the bytes of ONNX files; nothing of the machine that made it is in there."""

from __future__ import annotations

import logging
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import torch

from innerattn.policies.exported.backend import INPUT, MARK
from innerattn.train.export.actors import OnnxForm


def onnx_files(
    forms: Mapping[str, OnnxForm], width: int, marks: Mapping[str, str]
) -> dict[str, bytes]:
    """The ONNX files of actors by name, each for any number of observations at once.

    Args:
        forms: the actors, which differ in their weights alone: their graph is made once.
        width: D.
        marks: what each file says of itself, as of `innerattn.policies.exported.backend.onnx_mark`.
    """
    first, *_ = forms.values()
    files = {}
    with _quiet():
        program = torch.onnx.export(
            first.eval(),
            (torch.zeros(2, width),),
            dynamo=True,
            external_data=False,
            input_names=[INPUT],
            output_names=[*first.names],
            dynamic_shapes=({0: torch.export.Dim("batch", min=1)},),
            verbose=False,
            optimize=False,  # that computes with weights, and is done for those of each
        )
        assert program is not None  # as no file was asked for
        graph = program.model
        for name, form in forms.items():
            program.model = graph.clone()
            program.apply_weights(form.state_dict())
            program.optimize()
            files[name] = _bytes_of(program.model_proto, marks[name])
    return files


def _bytes_of(model: Any, mark: str) -> bytes:
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
