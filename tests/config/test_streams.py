"""Training and evaluation never draw from the same random streams."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from innerattn.config.streams import stream_seed

MOST = 2**63 - 1
SEEDS = st.integers(0, MOST) | st.integers(9_990, 10_010) | st.integers(0, 20)


@given(SEEDS, SEEDS)
def test_no_two_seeds_meet(one: int, other: int) -> None:
    assert stream_seed(one, "training") != stream_seed(other, "evaluation")
    assert stream_seed(one, "training") != stream_seed(one, "evaluation")
    for purpose in ("training", "evaluation"):
        found = stream_seed(one, purpose)
        assert 0 <= found < 2**64
        assert (found == stream_seed(other, purpose)) == (one == other)


def test_usual_seeds_stay_as_they_are() -> None:
    assert [stream_seed(seed, "training") for seed in (0, 9_999)] == [0, 9_999]
    assert [stream_seed(seed, "evaluation") for seed in (10_000, 12_345, MOST)] == [
        10_000,
        12_345,
        MOST,
    ]


@pytest.mark.parametrize("seed", [-1, 2**63])
def test_a_seed_out_of_range_is_refused(seed: int) -> None:
    with pytest.raises(ValueError, match=rf"seed = {seed}: must be in 0\.\.=9223372036854775807"):
        stream_seed(seed, "training")
