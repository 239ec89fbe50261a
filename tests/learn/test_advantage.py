"""Advantages and the scale of returns against numbers computed by hand and against plain loops."""

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from torch import Tensor

from innerattn.learn.advantage import ReturnScale, generalised_advantage


def one(values: list[float]) -> Tensor:
    """(T, 1, 1)."""
    return torch.tensor(values, dtype=torch.float64).view(-1, 1, 1)


def flags(*values: int) -> Tensor:
    """(T, 1)."""
    return torch.tensor(values, dtype=torch.bool).view(-1, 1)


@pytest.mark.parametrize(
    ("terminated", "ended", "expected"),
    [
        # d = 1 + 0.5 * 4 - 2, 2 + 0.5 * 6 - 4, 3 + 0.5 * 8 - 6 = 1, 1, 1; carried by 0.5 * 0.8.
        ((0, 0, 0), (0, 0, 0), [1 + 0.4 * 1.4, 1.4, 1.0]),
        # The time limit after the second step keeps the value behind it and stops the carry.
        ((0, 0, 0), (0, 1, 0), [1.4, 1.0, 1.0]),
        # A termination loses that value, too: d = 2 - 4.
        ((0, 1, 0), (0, 1, 0), [1 + 0.4 * -2, -2.0, 1.0]),
    ],
)
def test_advantages_by_hand(
    terminated: tuple[int, ...], ended: tuple[int, ...], expected: list[float]
) -> None:
    found = generalised_advantage(
        one([1, 2, 3]), one([2, 4, 6]), one([4, 6, 8]), flags(*terminated), flags(*ended), 0.5, 0.8
    )
    torch.testing.assert_close(found.flatten().tolist(), expected)


@given(
    seed=st.integers(0, 2**32 - 1),
    steps=st.integers(1, 12),
    gamma=st.floats(0, 1),
    gae_lambda=st.floats(0, 1),
)
def test_advantages_are_weighted_sums_of_what_follows(
    seed: int, steps: int, gamma: float, gae_lambda: float
) -> None:
    """A_t is the sum of (gamma lambda)^k d_t+k to the end of the episode: the definition."""
    rng = np.random.default_rng(seed)
    reward, value, after = rng.normal(size=(3, steps, 2, 3))
    ended = rng.random((steps, 3)) < 0.3
    terminated = ended & (rng.random((steps, 3)) < 0.5)
    found = generalised_advantage(
        *(torch.tensor(x) for x in (reward, value, after, terminated, ended)), gamma, gae_lambda
    )
    for env in range(3):
        for robot in range(2):
            for start in range(steps):
                expected, weight = 0.0, 1.0
                for step in range(start, steps):
                    bootstrap = 0.0 if terminated[step, env] else after[step, robot, env]
                    delta = reward[step, robot, env] + gamma * bootstrap - value[step, robot, env]
                    expected += weight * delta
                    weight *= gamma * gae_lambda
                    if ended[step, env]:
                        break
                assert found[start, robot, env].item() == pytest.approx(expected, abs=1e-10)


def test_the_scale_is_that_of_all_returns_seen() -> None:
    rng = np.random.default_rng(0)
    scale = ReturnScale(2, 0.9, torch.device("cpu"))
    open_returns, seen = np.zeros((2, 3)), []
    for _ in range(4):
        reward, ended = rng.normal(2.0, 3.0, size=(5, 2, 3)), rng.random((5, 3)) < 0.3
        scale.update(torch.tensor(reward), torch.tensor(ended))
        for step in range(5):
            open_returns = reward[step] + 0.9 * open_returns
            seen.append(open_returns.copy())
            open_returns *= ~ended[step]
    expected = np.stack(seen, axis=1).reshape(2, -1)
    assert scale.count.item() == expected.shape[1]
    np.testing.assert_allclose(scale.mean, expected.mean(axis=1), rtol=1e-12)
    np.testing.assert_allclose(scale.std(1e-3), expected.std(axis=1), rtol=1e-12)


def test_constant_rewards_of_nothing_are_divided_by_the_floor() -> None:
    scale = ReturnScale(1, 0.9, torch.device("cpu"))
    scale.update(torch.zeros(3, 1, 2), torch.zeros(3, 2, dtype=torch.bool))
    assert scale.std(0.01).tolist() == [0.01]
