"""Entropy of recorded attention, by hand."""

import math

import numpy as np
import pytest

from innerattn.config import Scenario
from innerattn.measures.attention import attention_entropy, entropy_of
from innerattn.records.record import Record, rescue_dtype


def record(weights: np.ndarray | None, lengths: list[int]) -> Record:
    scenario = Scenario()
    return Record(
        policy="p",
        scenario=scenario,
        robot_names=tuple(robot.name for robot in scenario.robots),
        seed=0,
        first_episode=0,
        lengths=np.array(lengths),
        rescues=np.zeros(0, rescue_dtype(scenario)),
        reward_names=("rescue",),
        rewards_total=np.zeros((len(lengths), 4, 1)),
        steps={} if weights is None else {"attention": weights.astype(np.float32)},
    )


def test_by_hand_and_only_what_happened() -> None:
    weights = np.zeros((2, 3, 2, 4, 4))  # E, T, H, R, R
    weights[:, :, 0] = (1 - np.eye(4)) / 3  # head 0 attends evenly
    weights[:, :, 1] = np.roll(np.eye(4), 1, axis=1)  # head 1 attends to one robot
    weights[0, 1, 1, 0] = [0, 0.5, 0.5, 0]
    weights[1, 1:] = np.nan  # after the end
    entropy = entropy_of(record(weights, [3, 1]))
    assert entropy is not None
    np.testing.assert_allclose(entropy.nats[:, 0], math.log(3), atol=1e-6)
    np.testing.assert_allclose(entropy.share[:, 0], 1.0, atol=1e-6)
    np.testing.assert_allclose(entropy.teammates[:, 0], 3.0, atol=1e-5)
    # One of four steps has two robots in view of robot 0.
    np.testing.assert_allclose(entropy.nats[:, 1], [math.log(2) / 4, 0, 0, 0], atol=1e-7)
    np.testing.assert_allclose(entropy.teammates[:, 1], [2**0.25, 1, 1, 1], atol=1e-6)


@pytest.mark.parametrize("robots", [1, 2])
def test_no_choice_has_no_share(robots: int) -> None:
    weights = np.broadcast_to((1 - np.eye(robots)), (1, 1, 2, robots, robots))
    entropy = entropy_of(record(weights, [1]))
    assert entropy is not None
    np.testing.assert_array_equal(entropy.nats, np.zeros((robots, 2)))
    assert np.isnan(entropy.share).all()


def test_no_attention_no_entropy() -> None:
    assert entropy_of(record(None, [3])) is None


def plain_entropy(weights: np.ndarray) -> list[list[float]]:
    batch, heads, robots, _ = weights.shape
    rows = []
    for robot in range(robots):
        row = []
        for head in range(heads):
            total = 0.0
            for b in range(batch):
                for w in weights[b, head, robot]:
                    total -= float(w) * math.log(w) if w > 0 else 0.0
            row.append(total / batch)
        rows.append(row)
    return rows


def test_entropy_against_a_plain_loop() -> None:
    rng = np.random.default_rng(0)
    weights = rng.dirichlet(np.full(4, 0.3), (6, 3, 4)).astype(np.float32)
    weights[0, 0, 0] = [0, 1, 0, 0]
    found = attention_entropy(weights)
    assert found.shape == (4, 3)
    np.testing.assert_allclose(found, plain_entropy(weights), atol=1e-12)


@pytest.mark.parametrize(("robots", "nats"), [(1, 0.0), (2, 0.0), (4, 1.0986122886681098)])
def test_entropy_of_even_attention(robots: int, nats: float) -> None:
    even = (1 - np.eye(robots)) / max(robots - 1, 1)
    weights = np.broadcast_to(even, (5, 2, robots, robots)).astype(np.float32)
    np.testing.assert_allclose(attention_entropy(weights), np.full((robots, 2), nats), atol=1e-6)


def test_entropy_takes_time_and_episodes_together() -> None:
    rng = np.random.default_rng(1)
    weights = rng.dirichlet(np.ones(3), (5, 7, 2, 3)).astype(np.float32)
    np.testing.assert_allclose(
        attention_entropy(weights), plain_entropy(weights.reshape(35, 2, 3, 3)), atol=1e-12
    )
