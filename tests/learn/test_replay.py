"""The replay memory against a plain list."""

import hypothesis.strategies as st
import pytest
import torch
from hypothesis import given, settings

from innerattn.learn import Replay, Team, Transitions

TEAM = Team(2, 3, 5)


def numbered(first: int, count: int) -> Transitions:
    """Transitions whose every part tells which one it is."""
    number = torch.arange(first, first + count, dtype=torch.float32)
    obs = number.view(-1, 1, 1) + torch.arange(6.0).view(1, 2, 3) / 8
    return Transitions(
        obs,
        torch.stack([number % 5, (number + 1) % 5], 1).long(),
        torch.stack([number, -number / 4], 1),
        obs + 0.0625,
        number % 3 == 0,
    )


@settings(max_examples=60)
@given(capacity=st.integers(1, 9), sizes=st.lists(st.integers(0, 12), max_size=8))
def test_it_holds_what_a_list_would(capacity: int, sizes: list[int]) -> None:
    replay = Replay(capacity, TEAM, seed=0)
    model: list[int] = []
    total = 0
    for size in sizes:
        replay.add(numbered(total, size))
        model = [*model, *range(total, total + size)][-capacity:]
        total += size
        assert len(replay) == len(model)
        rewards = torch.tensor([[n, -n / 4] for n in model] or [[0, 0]], dtype=torch.float64)
        torch.testing.assert_close(replay.reward_mean, rewards.mean(0))
        torch.testing.assert_close(
            replay.reward_std, rewards.std(0, correction=0), atol=1e-6, rtol=0
        )
    if not model:
        with pytest.raises(ValueError, match="empty"):
            replay.sample(1)
        return
    sample = replay.sample(300)
    drawn = sample.obs[:, 0, 0].long()
    assert set(drawn.tolist()) == set(model)
    whole = numbered(0, total)
    for got, expected in zip(sample[:5], whole[:5], strict=True):
        assert got.dtype == expected.dtype
        assert torch.equal(got, expected[drawn])


def test_draws_are_uniform_and_follow_the_seed() -> None:
    def draws(seed: int) -> torch.Tensor:
        replay = Replay(20, TEAM, seed)
        replay.add(numbered(0, 33))
        return replay.sample(20_000).obs[:, 0, 0].long()

    counts = torch.bincount(draws(0), minlength=33)[13:].double()
    assert ((counts - 1000) ** 2 / 1000).sum() < 43.8  # 0.1 % point of chi-square with 19 d.o.f.
    assert torch.equal(draws(0), draws(0))
    assert not torch.equal(draws(0), draws(1))


def test_another_team_is_refused() -> None:
    replay = Replay(4, Team(3, 3, 5), seed=0)
    with pytest.raises(ValueError, match=r"\(2, 2, 3\).*\(3, 3\)"):
        replay.add(numbered(0, 2))
    assert len(replay) == 0


def test_no_capacity_is_refused() -> None:
    with pytest.raises(ValueError, match="capacity = 0"):
        Replay(0, TEAM, seed=0)


def test_parts_of_rewards_are_weighed_when_they_are_drawn() -> None:
    source = torch.Generator().manual_seed(0)
    replay = Replay(20, TEAM, seed=1, reward_parts=3)
    plain = []
    for size in (15, 12):
        parts = torch.randn(size, 2, 3, generator=source)
        replay.add(numbered(len(plain), size)._replace(reward_parts=parts))
        plain += list(parts)
    kept = torch.stack(plain[-20:]).double()
    for weights in (torch.tensor([1.0, 0.0, 0.5]), torch.tensor([0.2, 2.0, 0.0])):
        replay.weigh(weights)
        rewards = kept @ weights.double()
        torch.testing.assert_close(replay.reward_mean, rewards.mean(0))
        torch.testing.assert_close(replay.reward_std, rewards.std(0, correction=0))
        drawn = replay.sample(50)
        rows = drawn.obs[:, 0, 0].long()
        torch.testing.assert_close(drawn.reward, torch.stack(plain)[rows] @ weights)


def test_rewards_without_parts_are_refused_where_parts_are_weighed() -> None:
    replay = Replay(4, TEAM, seed=0, reward_parts=3)
    with pytest.raises(ValueError, match=r"reward_parts: must be \(B, R, P\) with P = 3"):
        replay.add(numbered(0, 2))
    assert len(replay) == 0
