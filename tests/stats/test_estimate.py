"""Estimates with and without an interval, and how they are written and read."""

import json
import math
from dataclasses import dataclass

import numpy as np
import pytest

from innerattn.stats import Estimate
from innerattn.stats.estimate import as_json


@pytest.mark.parametrize(
    "estimate",
    [
        Estimate(0.5, 0.4, 0.6),
        Estimate(0.5, 0.4, 0.6, runs=3),
        Estimate(2.0, runs=1),
        Estimate(2.0),
    ],
)
def test_what_is_written_is_read_back(estimate: Estimate) -> None:
    document = json.loads(json.dumps(estimate.to_json(), allow_nan=False))
    assert Estimate.from_json(document) == estimate
    assert ("runs" in document) == (estimate.runs > 0)
    assert list(document)[:3] == ["mean", "low", "high"]


def test_an_interval_that_is_not_there_limits_nothing() -> None:
    alone = Estimate(2.0, runs=1)
    assert not alone.bounded
    assert alone.to_json() == {"mean": 2.0, "low": None, "high": None, "runs": 1}
    assert alone.low < -1e300
    assert alone.high > 1e300
    assert Estimate(2.0, 1.0, 3.0).bounded
    assert not Estimate(2.0, 1.0, math.inf).bounded


@pytest.mark.parametrize("document", [{"mean": 1.0}, {"mean": 1.0, "low": 0.0}])
def test_a_missing_key_is_an_error(document: dict[str, float]) -> None:
    with pytest.raises(KeyError):
        Estimate.from_json(document)


def test_a_value_as_json() -> None:
    @dataclass(frozen=True)
    class Pair:
        one: Estimate
        many: tuple[Estimate | None, ...]

    value = {"pair": Pair(Estimate(1.0, 0.0, 2.0), (None, Estimate(0.5, runs=1)))}
    value |= {"array": np.arange(2), "number": np.float64(0.5), "text": "a"}
    written = as_json(value)
    assert json.loads(json.dumps(written, allow_nan=False)) == written
    assert written == {
        "pair": {
            "one": {"mean": 1.0, "low": 0.0, "high": 2.0},
            "many": [None, {"mean": 0.5, "low": None, "high": None, "runs": 1}],
        },
        "array": [0, 1],
        "number": 0.5,
        "text": "a",
    }
