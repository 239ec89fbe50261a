"""Parameters by kind against networks whose rows are copies."""

import copy

import pytest
import torch
from torch import Tensor, nn

from innerattn.nn import Actor, Critic, EntityColumns, InnerAttention, PerRobotLinear, share_by_kind

KINDS = ["food", "medical", "food", "navigation", "medical"]
FIRST = [0, 1, 0, 3, 1]
"""For each robot the first of its kind."""
R, B, A, W = len(KINDS), 6, 5, 32
COLUMNS = EntityColumns(3, R - 1, 2, 2, 3, 0)
D = COLUMNS.width


def generator(seed: int = 0) -> torch.Generator:
    return torch.Generator().manual_seed(seed)


def make(name: str, entities: EntityColumns | None) -> nn.Module:
    source = generator()
    if name == "actor":
        return Actor(R, D, A, W, source, entities).double()
    attention = InnerAttention(W, 2, source)
    return Critic(R, D, A, attention, source, entities=entities).double()


def output(network: nn.Module, obs: Tensor) -> Tensor:
    if isinstance(network, Actor):
        return network(obs)
    actions = torch.arange(R * B).view(R, B) % A
    return network(obs, actions).q


def layers(network: nn.Module) -> dict[str, PerRobotLinear]:
    return {
        name: layer for name, layer in network.named_modules() if isinstance(layer, PerRobotLinear)
    }


@pytest.mark.parametrize("entities", [None, COLUMNS])
@pytest.mark.parametrize("name", ["actor", "critic"])
def test_values_and_gradients_are_those_of_copies(
    name: str, entities: EntityColumns | None
) -> None:
    copies = make(name, entities)
    shared = copy.deepcopy(copies)
    share_by_kind(shared, KINDS)
    with torch.no_grad():
        for layer in layers(copies).values():
            for parameter in (layer.weight, layer.bias):
                parameter.copy_(parameter[FIRST].clone())
    obs = torch.randn(R, B, D, generator=generator(1), dtype=torch.float64)
    found, expected = output(shared, obs), output(copies, obs)
    torch.testing.assert_close(found, expected)
    found.square().sum().backward()
    expected.square().sum().backward()
    trained = dict(shared.named_parameters())
    for place, layer in layers(copies).items():
        for last, parameter in layer.named_parameters():
            one = trained.pop(f"{place}.parametrizations.{last}.original")
            added = torch.zeros_like(one)
            for robot, kind in enumerate(KINDS):
                added[["food", "medical", "navigation"].index(kind)] += parameter.grad[robot]
            torch.testing.assert_close(one.grad, added)
    assert all(one.startswith("attention.") for one in trained)


def test_several_threads_give_the_same_bytes() -> None:
    torch.set_num_threads(4)
    try:
        robots, width = 8, 256
        layer = PerRobotLinear(robots, width, width, generator())
        share_by_kind(layer, ["food"] * robots)
        x = torch.randn(robots, 32, width, generator=generator(1))
        gradients = set()
        for _ in range(20):
            layer.zero_grad()
            layer(x).square().sum().backward()
            (weight, _) = layer.parameters()
            gradients.add(weight.grad.numpy().tobytes())
        assert len(gradients) == 1
    finally:
        torch.set_num_threads(1)


def test_robots_of_a_kind_act_alike() -> None:
    actor = make("actor", None)
    share_by_kind(actor, KINDS)
    obs = torch.randn(1, B, D, generator=generator(1), dtype=torch.float64).expand(R, B, D)
    logits = actor(obs)
    for robot in range(R):
        torch.testing.assert_close(logits[robot], logits[FIRST[robot]])
    assert (logits[0] - logits[1]).abs().min() > 1e-6
    assert (logits[0] - logits[3]).abs().min() > 1e-6


def test_kinds_of_one_robot_each_change_nothing() -> None:
    plain = make("critic", None)
    shared = copy.deepcopy(plain)
    share_by_kind(shared, [f"kind {robot}" for robot in range(R)])
    obs = torch.randn(R, B, D, generator=generator(1), dtype=torch.float64)
    assert torch.equal(output(shared, obs), output(plain, obs))
