"""Exported policies that pool entities: numpy and ONNX give the numbers of the trained actor."""

from dataclasses import asdict, replace
from functools import cache
from pathlib import Path

import numpy as np
import onnxruntime
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from made_export import FRAMED, made_export

from innerattn.config import Scenario
from innerattn.nn import Actor, EntityColumns
from innerattn.policies import Exported
from innerattn.policies.exported.contract import Entities, Network
from innerattn.policies.exported.network import NumpyActor, layer_shapes
from innerattn.train.export.actors import OnnxForm, TeamActors
from innerattn.train.export.onnx_file import onnx_files

POOLINGS = ("attention", "mean", "max", "nearest")
SEEN, PRESENT = 3, 0
COLUMNS = EntityColumns(4, 3, 5, 2, 4, PRESENT, SEEN, (0, 2), (2, 3))
HIDDEN, OUTPUTS = 64, 5


def columns(seen: bool, robots: int = 4) -> EntityColumns:
    return replace(COLUMNS, seen=SEEN if seen else None, teammates=robots - 1)


@cache
def actor(pooling: str, seen: bool, robots: int = 4) -> Actor:
    given = columns(seen, robots)
    source = torch.Generator().manual_seed(5)
    return Actor(1, given.width, OUTPUTS, HIDDEN, source, given, pooling=pooling)


def network(pooling: str, seen: bool, robots: int = 4) -> Network:
    entities = Entities(**asdict(columns(seen, robots)))
    return Network("entities", HIDDEN, 0.01, entities, None, None, pooling)  # type: ignore[arg-type]


def numpy_actor(pooling: str, seen: bool, robots: int = 4) -> NumpyActor:
    tensors = TeamActors(("one",), {"one": actor(pooling, seen, robots)}).tensors()
    arrays = {name.removeprefix("one."): tensor.numpy() for name, tensor in tensors.items()}
    described = network(pooling, seen, robots)
    return NumpyActor(described, arrays, columns(seen, robots).width, OUTPUTS, None)


def rows(count: int, seed: int, robots: int = 4) -> np.ndarray:
    """Rows in which some entities are not there; all are in the first row, none in the last."""
    draws, given = np.random.default_rng(seed), columns(True, robots)
    found = draws.normal(size=(count, given.width)).astype(np.float32)
    last = given.own + given.teammates * given.teammate
    mates = found[:, given.own : last].reshape(count, given.teammates, given.teammate)
    victims = found[:, last:].reshape(count, given.victims, given.victim)
    for blocks, flag in ((mates, SEEN), (victims, PRESENT)):
        there = draws.integers(0, 2, blocks.shape[:2])
        there[0], there[-1] = 1, 0
        blocks[:] *= there[..., None]
        blocks[..., flag] = there
    found[:, given.own : last] = mates.reshape(count, -1)
    found[:, last:] = victims.reshape(count, -1)
    return found


def trained(pooling: str, seen: bool, given: np.ndarray, robots: int = 4) -> np.ndarray:
    with torch.no_grad():
        logits: np.ndarray = actor(pooling, seen, robots)(torch.from_numpy(given[None]))[0].numpy()
    return logits.T


@given(st.sampled_from(POOLINGS), st.booleans(), st.integers(1, 4), st.integers(0, 2**32))
def test_numpy_gives_the_numbers_of_the_actor(
    pooling: str, seen: bool, robots: int, seed: int
) -> None:
    given = rows(33, seed, robots)
    found = numpy_actor(pooling, seen, robots).logits(given)
    np.testing.assert_allclose(found, trained(pooling, seen, given, robots), atol=2e-6)


@pytest.mark.parametrize(
    ("pooling", "seen"),
    [
        ("nearest", False),
        *(
            pytest.param(pooling, seen, marks=pytest.mark.long)
            for pooling in POOLINGS
            for seen in (False, True)
            if (pooling, seen) != ("nearest", False)
        ),
    ],
)
def test_onnx_gives_the_numbers_of_the_actor(pooling: str, seen: bool) -> None:
    given, width = rows(257, 1), columns(seen).width
    data = onnx_files({"one": OnnxForm(actor(pooling, seen), None)}, width, {"one": ""})["one"]
    session = onnxruntime.InferenceSession(data, providers=["CPUExecutionProvider"])
    (found,) = session.run(["logits"], {"observation": given})
    np.testing.assert_allclose(found, trained(pooling, seen, given), atol=2e-6)
    np.testing.assert_allclose(found, numpy_actor(pooling, seen).logits(given), atol=2e-6)


@pytest.mark.long
@pytest.mark.parametrize("pooling", POOLINGS)
def test_the_contract_says_how_a_team_pools(pooling: str, tmp_path: Path) -> None:
    robots = [one.replace(sight_m=0.8).model_dump() for one in Scenario().robots]
    values = {**FRAMED, "network.pooling": pooling, "scenario.robots": robots}
    _, folder = made_export(tmp_path, "ppo-inner", **values)
    contract = Exported(folder, backend="numpy").contract
    assert contract.network.pooling == pooling
    assert contract.checked is not None
    assert contract.checked.same_greedy_action == contract.checked.observations
    names, entities = [one.name for one in contract.observation], contract.network.entities
    assert entities is not None
    assert entities.seen is not None
    assert names[entities.own + entities.seen] == "teammate_0.seen"
    assert (entities.victim_place is not None) == (pooling == "nearest")


WRONG = [
    ({"pooling": "mean", "encoder": "flat", "entities": None}, r"^network\.pooling: must be 'att"),
    ({"pooling": "nearest", "victim_place": None}, r"^network\.entities\.victim_place: is missing"),
    ({"pooling": "nearest", "teammate_place": None}, r"teammate_place: is missing"),
    ({"pooling": "nearest", "teammate_place": (0, 5)}, r"a teammate has 5 columns, not column 5$"),
    ({"seen": 9}, r"^network\.entities: a teammate has 5 columns, not column 9$"),
    ({"present": 4}, r"^network\.entities: a victim has 4 columns, not column 4$"),
]


@pytest.mark.parametrize(("change", "message"), WRONG)
def test_contracts_that_do_not_fit_are_refused(change: dict[str, object], message: str) -> None:
    described = network("attention", seen=True)
    assert "first.query" in layer_shapes(described, COLUMNS.width, OUTPUTS)
    assert described.entities is not None
    of_network = {key: one for key, one in change.items() if hasattr(described, key)}
    of_entities = {key: one for key, one in change.items() if key not in of_network}
    wrong = replace(described, entities=replace(described.entities, **of_entities))
    with pytest.raises(ValueError, match=message):
        layer_shapes(replace(wrong, **of_network), COLUMNS.width, OUTPUTS)
