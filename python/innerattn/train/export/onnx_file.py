"""Actors as the bytes of ONNX files; nothing of the machine that made it is in there."""

from __future__ import annotations

import logging
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import torch

from innerattn.policies.exported.backend import INPUT, LOGITS, MARK, PROBABILITIES
from innerattn.policies.exported.view import ABILITIES, ROBOTS, VICTIMS, VIEW
from innerattn.train.export.actors import OnnxForm
from innerattn.train.export.view_form import ViewForm

_MOST = 4096
"""Robots, victims and abilities that a policy for any team is made for."""


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


def view_file(form: ViewForm, mark: str) -> bytes:
    """The ONNX file of a policy for any team, for one robot's view of any sizes.

    Args:
        form: the policy.
        mark: what the file says of itself, as of `innerattn.policies.exported.backend.onnx_mark`.
    """
    sizes = {
        name: torch.export.Dim(name, min=least, max=_MOST)
        for name, least in ((ROBOTS, 1), (VICTIMS, 0), (ABILITIES, 1))
    }
    shapes = tuple(
        {place: sizes[size] for place, size in enumerate(shape) if isinstance(size, str)}
        for shape in VIEW.values()
    )
    few = {ROBOTS: 3, VICTIMS: 4, ABILITIES: 5}
    view = {
        name: torch.ones([one if isinstance(one, int) else few[one] for one in shape])
        for name, shape in VIEW.items()
    }
    view["present"] = view["present"].bool()
    with _quiet():
        program = torch.onnx.export(
            form.eval(),
            tuple(view.values()),
            dynamo=True,
            external_data=False,
            input_names=[*VIEW],
            output_names=[LOGITS, PROBABILITIES],
            dynamic_shapes=(shapes,),
            verbose=False,
        )
    assert program is not None  # as no file was asked for
    return _bytes_of(program.model_proto, mark)


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
