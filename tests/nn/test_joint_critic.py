"""The critic without attention against straight matrix algebra, and what it may depend on."""

import pytest
import torch
from torch import Tensor

from innerattn.nn import CentralCritic, JointCritic

R, B, D, W = 3, 6, 4, 8


def generator(seed: int) -> torch.Generator:
    return torch.Generator().manual_seed(seed)


def make(robots: int = R, outputs: int = 1) -> JointCritic:
    return JointCritic(robots, D, outputs, W, generator(0)).double()


def observations(robots: int = R, seed: int = 1) -> Tensor:
    return torch.randn(robots, B, D, generator=generator(seed), dtype=torch.float64)


def some_actions(robots: int = R) -> Tensor:
    return torch.zeros(robots, B, dtype=torch.int64)


@pytest.mark.parametrize("outputs", [1, 5])
@pytest.mark.parametrize("robots", [1, 2, 4])
def test_values_against_a_plain_loop(robots: int, outputs: int) -> None:
    critic, obs = make(robots, outputs), observations(robots)
    found = critic(obs, some_actions(robots))
    assert found.attended is None
    assert found.q.shape == (robots, outputs, B)
    parts = dict(critic.named_parameters())
    for i in range(robots):
        for b in range(B):
            x = torch.cat([obs[j, b] for j in range(robots)])
            for layer in ("first", "second", "output"):
                x = parts[f"{layer}.weight"][i] @ x + parts[f"{layer}.bias"][i]
                x = x if layer == "output" else torch.where(x > 0, x, 0.01 * x)
            torch.testing.assert_close(found.q[i, :, b], x, rtol=1e-10, atol=1e-10)


def test_every_robot_has_parameters_of_its_own() -> None:
    critic, obs = make(), observations()
    before = critic(obs, some_actions()).q
    with torch.no_grad():
        for parameter in critic.parameters():
            parameter[1] += 0.1
    after = critic(obs, some_actions()).q
    assert torch.equal(after[[0, 2]], before[[0, 2]])
    assert (after[1] - before[1]).abs().min() > 1e-6


def test_every_observation_is_heeded_and_no_action() -> None:
    critic, obs = make(), observations()
    before = critic(obs, some_actions()).q
    assert torch.equal(critic(obs, some_actions() + 2).q, before)
    unavailable = torch.zeros(B, R, dtype=torch.bool)
    assert torch.equal(critic(obs, some_actions(), unavailable).q, before)
    for robot in range(R):
        changed = obs.clone()
        changed[robot] += 1.0
        assert (critic(changed, some_actions()).q - before).abs().min() > 1e-6


def test_worlds_are_apart() -> None:
    critic, obs = make(), observations()
    order = torch.tensor([3, 1, 5, 0, 2, 4])
    torch.testing.assert_close(
        critic(obs[:, order], some_actions()).q, critic(obs, some_actions()).q[:, :, order]
    )


@pytest.mark.parametrize("outputs", [1, 5])
@pytest.mark.parametrize("robots", [1, 2, 4])
def test_one_network_for_all_against_a_plain_loop(robots: int, outputs: int) -> None:
    critic = CentralCritic(robots, D, outputs, W, generator(0)).double()
    obs = observations(robots)
    found = critic(obs, some_actions(robots))
    assert found.attended is None
    assert found.q.shape == (robots, outputs, B)
    parts = dict(critic.named_parameters())
    for b in range(B):
        x = torch.cat([obs[j, b] for j in range(robots)])
        for layer in ("first", "second", "output"):
            x = parts[f"{layer}.weight"][0] @ x + parts[f"{layer}.bias"][0]
            x = x if layer == "output" else torch.where(x > 0, x, 0.01 * x)
        torch.testing.assert_close(found.q[:, :, b].flatten(), x, rtol=1e-10, atol=1e-10)
