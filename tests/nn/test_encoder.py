"""The encoder by entities against plain loops, and what it may depend on."""

import pytest
import torch
from torch import Tensor

from innerattn.nn import (
    Actor,
    Critic,
    EntityColumns,
    EntityEncoder,
    InnerAttention,
    PerRobotLinear,
)

B, HEAD = 7, 8
VICTIMS, VICTIM, PRESENT = 3, 4, 1
OWN, TEAMMATE = 3, 5


def generator(seed: int = 0) -> torch.Generator:
    return torch.Generator().manual_seed(seed)


def columns(robots: int) -> EntityColumns:
    return EntityColumns(OWN, robots - 1, TEAMMATE, VICTIMS, VICTIM, PRESENT)


def make(robots: int = 4, extra: int = 0, out: int = 64) -> EntityEncoder:
    return EntityEncoder(robots, columns(robots), extra, out, generator()).double()


def observations(robots: int = 4, extra: int = 0) -> Tensor:
    """(R, B, D + extra); the first world has no victim, the second all."""
    source, given = generator(1), columns(robots)
    obs = torch.randn(robots, B, given.width + extra, generator=source, dtype=torch.float64)
    flags = victims_of(obs)[..., PRESENT]
    flags.copy_(torch.rand(flags.shape, generator=source).round())
    flags[:, 0], flags[:, 1] = 0.0, 1.0
    return obs


def teammates_of(obs: Tensor) -> Tensor:
    """A view (R, B, T, columns)."""
    last = OWN + (len(obs) - 1) * TEAMMATE
    return obs[:, :, OWN:last].view(len(obs), B, len(obs) - 1, TEAMMATE)


def victims_of(obs: Tensor) -> Tensor:
    """A view (R, B, V, columns)."""
    first = OWN + (len(obs) - 1) * TEAMMATE
    last = first + VICTIMS * VICTIM
    return obs[:, :, first:last].view(len(obs), B, VICTIMS, VICTIM)


def affine(encoder: EntityEncoder, layer: str, robot: int, x: Tensor) -> Tensor:
    found = encoder.get_submodule(layer)
    return found.weight[robot] @ x + found.bias[robot]


def leaky(x: Tensor) -> Tensor:
    return torch.where(x > 0, x, 0.01 * x)


def attend(entities: list[Tensor], query: Tensor) -> Tensor:
    """One head after the other, one entity after the other."""
    mixed = torch.zeros_like(query)
    for head in range(len(query) // HEAD if entities else 0):
        part = slice(head * HEAD, (head + 1) * HEAD)
        shares = [(query[part] @ entity[part] / HEAD**0.5).exp() for entity in entities]
        for share, entity in zip(shares, entities, strict=True):
            mixed[part] += share / sum(shares) * entity[part]
    return mixed


def plain(encoder: EntityEncoder, obs: Tensor, robot: int, row: int) -> Tensor:
    given = columns(len(obs))
    own = torch.cat([obs[robot, row, :OWN], obs[robot, row, given.width :]])
    encoded = leaky(affine(encoder, "own", robot, own))
    queries = affine(encoder, "query", robot, encoded).split(len(encoded))
    present = [victim for victim in victims_of(obs)[robot, row] if victim[PRESENT] > 0.5]
    victims = [leaky(affine(encoder, "victim", robot, victim)) for victim in present]
    parts = [encoded, attend(victims, queries[0])]
    if len(obs) > 1:
        teammates = [
            leaky(affine(encoder, "teammate", robot, teammate))
            for teammate in teammates_of(obs)[robot, row]
        ]
        parts.append(attend(teammates, queries[1]))
    return affine(encoder, "output", robot, torch.cat(parts))


@pytest.mark.parametrize("out", [6, 64])
@pytest.mark.parametrize("extra", [0, 2])
@pytest.mark.parametrize("robots", [1, 2, 4])
def test_encodings_and_gradients_against_plain_loops(robots: int, extra: int, out: int) -> None:
    encoder, obs = make(robots, extra, out), observations(robots, extra)
    found = encoder(obs)
    expected = torch.stack(
        [torch.stack([plain(encoder, obs, i, b) for b in range(B)]) for i in range(robots)]
    )
    torch.testing.assert_close(found, expected, rtol=1e-10, atol=1e-10)
    weights = torch.randn(found.shape, generator=generator(2), dtype=torch.float64)
    parameters = dict(encoder.named_parameters())
    gradients = [
        torch.autograd.grad((weights * y).sum(), list(parameters.values()))
        for y in (found, expected)
    ]
    for name, one, other in zip(parameters, *gradients, strict=True):
        assert one.any(), name
        torch.testing.assert_close(one, other, rtol=1e-9, atol=1e-10)


def test_the_order_of_slots_does_not_matter() -> None:
    encoder, obs = make(), observations()
    before, changed = encoder(obs), obs.clone()
    teammates_of(changed).copy_(teammates_of(obs)[:, :, [2, 0, 1]])
    victims_of(changed).copy_(victims_of(obs)[:, :, [1, 2, 0]])
    assert not torch.equal(changed, obs)
    torch.testing.assert_close(encoder(changed), before, rtol=1e-12, atol=1e-12)


def test_absent_victims_have_no_influence_and_the_others_have() -> None:
    encoder, obs = make(), observations()
    before, changed = encoder(obs), obs.clone()
    victims = victims_of(changed)
    absent = victims[..., PRESENT] < 0.5
    victims[absent] = 100.0 * torch.randn(VICTIM, generator=generator(3), dtype=torch.float64)
    victims[..., PRESENT][absent] = 0.0
    assert torch.equal(encoder(changed), before)
    victims[1, 1, 2, 0] += 1.0
    assert (encoder(changed)[1, 1] - before[1, 1]).abs().max() > 1e-4


def test_a_world_without_victims_has_finite_gradients() -> None:
    encoder, obs = make(), (1e3 * observations()).requires_grad_()
    encoder(obs)[:, :1].square().sum().backward()
    assert obs.grad is not None
    assert obs.grad.isfinite().all()
    assert not victims_of(obs.grad)[:, 0].any()
    for parameter in encoder.parameters():
        assert parameter.grad is not None
        assert parameter.grad.isfinite().all()


def test_every_robot_has_parameters_of_its_own() -> None:
    encoder, obs = make(), observations()
    before = encoder(obs)
    with torch.no_grad():
        for parameter in encoder.parameters():
            parameter[1] += 0.1
    after = encoder(obs)
    assert torch.equal(after[[0, 2, 3]], before[[0, 2, 3]])
    assert not torch.isclose(after[1], before[1]).any()


def test_networks_without_entities_are_drawn_as_ever() -> None:
    source, robots, width, actions = generator(), 3, 11, 5
    actor = Actor(robots, width, actions, 8, source)
    critic = Critic(robots, width, actions, InnerAttention(8, 2, source), source)
    source = generator()
    in_order = [PerRobotLinear(robots, *sizes, source) for sizes in ((width, 8), (8, 8), (8, 5))]
    InnerAttention(8, 2, source)
    in_order += [
        PerRobotLinear(robots, *sizes, source)
        for sizes in ((width, 8), (width + actions, 8), (16, 8), (8, 5))
    ]
    found = [actor.first, actor.second, actor.output]
    found += [critic.state_encoder, critic.action_encoder, critic.hidden, critic.output]
    for one, other in zip(found, in_order, strict=True):
        assert torch.equal(one.weight, other.weight)
        assert torch.equal(one.bias, other.bias)


def test_own_values_by_entities_ignore_the_own_action_and_heed_those_of_teammates() -> None:
    robots, source, given = 3, generator(), columns(3)
    attention = InnerAttention(8, 2, source)
    critic = Critic(robots, given.width, 5, attention, source, entities=given).double()
    obs, actions = observations(robots), torch.zeros(robots, B, dtype=torch.int64)
    before = critic(obs, actions).q
    actions[1] = 3
    after = critic(obs, actions).q
    assert torch.equal(after[1], before[1])
    for i in (0, 2):
        assert (after[i] - before[i]).abs().min() > 1e-7
