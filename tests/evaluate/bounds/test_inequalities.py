"""How far softmax weights can move when logits do."""

from itertools import product

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from innerattn.evaluate.bounds.inequalities import largest_weight_change, violated


@pytest.mark.parametrize("teammates", [1, 2, 4])
@given(data=st.data())
def test_weights_never_move_further_than_tanh(teammates: int, data: st.DataObject) -> None:
    def row(limit: float) -> NDArray:
        number = st.floats(-limit, limit)
        return np.array(data.draw(st.lists(number, min_size=teammates, max_size=teammates)))

    def softmax(x: NDArray) -> NDArray:
        exp = np.exp(x - x.max())
        return exp / exp.sum()

    logits, shifts = row(20.0), row(10.0)
    one = np.where(np.arange(teammates) == 0, shifts, 0.0)  # a single logit
    change = abs(softmax(logits + one) - softmax(logits))[0]
    assert change <= np.tanh(abs(shifts[0]) / 4) + 1e-12
    assert change <= largest_weight_change(torch.tensor(abs(shifts[0]))).item() + 1e-12
    moved = softmax(logits + shifts) - softmax(logits)
    spread, farthest = shifts.max() - shifts.min(), abs(shifts).max()
    for chosen in product([False, True], repeat=teammates):
        assert abs(moved[list(chosen)].sum()) <= np.tanh(spread / 4) + 1e-12
    assert abs(moved).sum() / 2 <= np.tanh(spread / 4) + 1e-12
    assert np.tanh(spread / 4) <= np.tanh(farthest / 2) + 1e-12


@pytest.mark.parametrize("shift", [0.1, 1.0, 6.0])
def test_the_tanh_is_attained(shift: float) -> None:
    half = torch.tensor(shift / 2, dtype=torch.float64)
    zero = torch.zeros_like(half)
    one = torch.stack([half, zero]).softmax(0) - torch.stack([-half, zero]).softmax(0)
    torch.testing.assert_close(one[0], largest_weight_change(2 * half))  # one logit, by 2 half
    both = torch.stack([half, -half]).softmax(0) - torch.stack([-half, half]).softmax(0)
    torch.testing.assert_close(both[0], largest_weight_change(2 * (2 * half)))  # D = 2 half


def test_the_tolerance_is_for_rounding_only() -> None:
    bound = torch.tensor([0.0, 1.0, 1e3], dtype=torch.float64)
    assert not violated(bound * (1 + 5e-11) + 5e-11, bound).any()
    assert violated(bound * (1 + 2e-10) + 2e-10, bound).all()
    assert violated(torch.tensor([torch.nan, 0.0]), torch.tensor([1.0, torch.nan])).all()
