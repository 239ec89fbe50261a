"""The encoder by entities against plain loops, and what it may depend on."""

from dataclasses import replace

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
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
VICTIMS, VICTIM, PRESENT, VICTIM_PLACE = 3, 4, 1, (2, 3)
OWN, TEAMMATE, SEEN, TEAMMATE_PLACE = 3, 5, 4, (2, 0)
POOLINGS = ("attention", "mean", "max", "nearest")


def generator(seed: int = 0) -> torch.Generator:
    return torch.Generator().manual_seed(seed)


def columns(robots: int, seen: bool = False) -> EntityColumns:
    flag = SEEN if seen else None
    sizes = OWN, robots - 1, TEAMMATE, VICTIMS, VICTIM, PRESENT
    return EntityColumns(*sizes, flag, TEAMMATE_PLACE, VICTIM_PLACE)


def make(
    robots: int = 4, extra: int = 0, out: int = 64, pooling: str = "attention", seen: bool = False
) -> EntityEncoder:
    given = columns(robots, seen)
    return EntityEncoder(robots, given, extra, out, generator(), pooling).double()


def observations(robots: int = 4, extra: int = 0, seed: int = 1) -> Tensor:
    """(R, B, D + extra); the first world has no victim, the second all.

    Nothing is known of some teammates, of all in the first world and of none in the second.
    """
    source, given = generator(seed), columns(robots)
    obs = torch.randn(robots, B, given.width + extra, generator=source, dtype=torch.float64)
    flags, seen = victims_of(obs)[..., PRESENT], teammates_of(obs)[..., SEEN]
    for one in (flags, seen):
        one.copy_(torch.rand(one.shape, generator=source).round())
        one[:, 0], one[:, 1] = 0.0, 1.0
    teammates_of(obs)[seen == 0.0] = 0.0
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


def sum_up(pooling: str, entities: list[Tensor], distances: list[float], width: int) -> Tensor:
    """The mean, the largest numbers or the nearest of entities, one after the other."""
    found = torch.zeros(width, dtype=torch.float64)
    if not entities:
        return found
    if pooling == "nearest":
        return entities[distances.index(min(distances))]
    if pooling == "mean":
        for entity in entities:
            found = found + entity / len(entities)
        return found
    return torch.stack([max(numbers) for numbers in zip(*entities, strict=True)])


def plain(
    encoder: EntityEncoder, obs: Tensor, robot: int, row: int, pooling: str, seen: bool
) -> Tensor:
    given = columns(len(obs))
    own = torch.cat([obs[robot, row, :OWN], obs[robot, row, given.width :]])
    encoded = leaky(affine(encoder, "own", robot, own))
    parts, groups = [encoded], [("victim", victims_of(obs), VICTIM_PLACE)]
    groups += [("teammate", teammates_of(obs), TEAMMATE_PLACE)] if len(obs) > 1 else []
    for number, (layer, blocks, place) in enumerate(groups):
        there = []
        for one in blocks[robot, row]:
            if layer == "victim":
                known = one[PRESENT] > 0.5
            elif seen:
                known = one[SEEN] > 0.5
            else:
                known = pooling == "attention" or bool((one != 0.0).any())
            there += [one] if known else []
        entities = [leaky(affine(encoder, layer, robot, one)) for one in there]
        if pooling == "attention":
            query = affine(encoder, "query", robot, encoded).split(len(encoded))[number]
            parts.append(attend(entities, query))
        else:
            distances = [sum(float(one[axis]) ** 2 for axis in place) for one in there]
            parts.append(sum_up(pooling, entities, distances, len(encoded)))
    return affine(encoder, "output", robot, torch.cat(parts))


def plain_all(encoder: EntityEncoder, obs: Tensor, pooling: str, seen: bool) -> Tensor:
    rows = [
        torch.stack([plain(encoder, obs, i, b, pooling, seen) for b in range(B)])
        for i in range(len(obs))
    ]
    return torch.stack(rows)


@pytest.mark.parametrize(("extra", "out", "seen"), [(2, 64, True), (0, 64, False), (0, 6, True)])
@torch.no_grad()
def test_weights_on_teammates_against_plain_loops(extra: int, out: int, seen: bool) -> None:
    encoder, obs = make(4, extra, out, seen=seen), observations(4, extra)
    weights = encoder.teammate_weights(obs)
    assert weights is not None
    assert weights.shape == (4, max(1, out // 32), 3, B)
    for robot, row in ((i, b) for i in range(4) for b in range(B)):
        own = torch.cat([obs[robot, row, :OWN], obs[robot, row, columns(4).width :]])
        encoded = leaky(affine(encoder, "own", robot, own))
        query = affine(encoder, "query", robot, encoded)[len(encoded) :]
        mates = list(teammates_of(obs)[robot, row])
        keys = [leaky(affine(encoder, "teammate", robot, one)) for one in mates]
        for head in range(len(query) // HEAD):
            part = slice(head * HEAD, (head + 1) * HEAD)
            shares = [float((query[part] @ key[part] / HEAD**0.5).exp()) for key in keys]
            shares = [
                x * (one[SEEN] > 0.5 or not seen) for x, one in zip(shares, mates, strict=True)
            ]
            whole = float(sum(shares)) or 1.0
            expected = torch.tensor([float(x) / whole for x in shares], dtype=torch.float64)
            torch.testing.assert_close(weights[robot, head, :, row], expected)


@pytest.mark.parametrize(("robots", "pooling"), [(1, "attention"), (4, "mean"), (4, "nearest")])
def test_only_attention_to_teammates_has_weights(robots: int, pooling: str) -> None:
    assert make(robots, pooling=pooling).teammate_weights(observations(robots)) is None


@pytest.mark.parametrize(
    ("robots", "extra", "out", "pooling", "seen"),
    [
        *((robots, 2, 64, pooling, True) for robots in (1, 4) for pooling in POOLINGS),
        *((4, 0, out, pooling, False) for out in (6, 64) for pooling in POOLINGS),
        (2, 0, 64, "attention", False),
    ],
)
def test_encodings_and_gradients_against_plain_loops(
    robots: int, extra: int, out: int, pooling: str, seen: bool
) -> None:
    encoder, obs = make(robots, extra, out, pooling, seen), observations(robots, extra)
    found, expected = encoder(obs), plain_all(encoder, obs, pooling, seen)
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


@given(
    st.integers(1, 5), st.integers(0, 2), st.sampled_from(POOLINGS), st.booleans(), st.integers(0)
)
def test_encodings_of_any_rows_against_plain_loops(
    robots: int, extra: int, pooling: str, seen: bool, seed: int
) -> None:
    encoder = make(robots, extra, 64, pooling, seen)
    obs = observations(robots, extra, seed % 2**63)
    with torch.no_grad():
        expected = plain_all(encoder, obs, pooling, seen)
        torch.testing.assert_close(encoder(obs), expected, rtol=1e-10, atol=1e-10)


@pytest.mark.parametrize("seen", [False, True])
@pytest.mark.parametrize("pooling", POOLINGS)
def test_the_order_of_slots_does_not_matter(pooling: str, seen: bool) -> None:
    encoder, obs = make(pooling=pooling, seen=seen), observations()
    before, changed = encoder(obs), obs.clone()
    teammates_of(changed).copy_(teammates_of(obs)[:, :, [2, 0, 1]])
    victims_of(changed).copy_(victims_of(obs)[:, :, [1, 2, 0]])
    assert not torch.equal(changed, obs)
    torch.testing.assert_close(encoder(changed), before, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("pooling", POOLINGS)
def test_absent_victims_have_no_influence_and_the_others_have(pooling: str) -> None:
    encoder, obs = make(pooling=pooling), observations()
    before, changed = encoder(obs), obs.clone()
    victims = victims_of(changed)
    absent = victims[..., PRESENT] < 0.5
    victims[absent] = 100.0 * torch.randn(VICTIM, generator=generator(3), dtype=torch.float64)
    victims[..., PRESENT][absent] = 0.0
    assert torch.equal(encoder(changed), before)
    victims[1, 1, :, 0] += 1.0
    assert (encoder(changed)[1, 1] - before[1, 1]).abs().max() > 1e-4


@pytest.mark.parametrize("pooling", POOLINGS)
def test_teammates_that_are_not_seen_have_no_influence_and_the_others_have(pooling: str) -> None:
    encoder, obs = make(pooling=pooling, seen=True), observations()
    before, changed = encoder(obs), obs.clone()
    teammates = teammates_of(changed)
    unseen = teammates[..., SEEN] < 0.5
    teammates[unseen] = 100.0 * torch.randn(TEAMMATE, generator=generator(3), dtype=torch.float64)
    teammates[..., SEEN][unseen] = 0.0
    assert torch.equal(encoder(changed), before)
    teammates[1, 1, :, 1] += 1.0
    assert (encoder(changed)[1, 1] - before[1, 1]).abs().max() > 1e-4


@pytest.mark.parametrize("pooling", POOLINGS[1:])
def test_more_teammates_of_whom_nothing_is_known_change_nothing(pooling: str) -> None:
    """Where no column says who is seen; the slots are others, so the parameters are copied."""
    few, many = (
        make(2, pooling=pooling),
        EntityEncoder(
            2,
            EntityColumns(
                OWN, 3, TEAMMATE, VICTIMS, VICTIM, PRESENT, None, TEAMMATE_PLACE, VICTIM_PLACE
            ),
            0,
            64,
            generator(),
            pooling,
        ).double(),
    )
    many.load_state_dict(few.state_dict())
    obs = observations(2)
    own, teammate, victims = obs.split([OWN, TEAMMATE, VICTIMS * VICTIM], dim=2)
    nothing = torch.zeros_like(teammate)
    wider = torch.cat([own, nothing, teammate, nothing, victims], dim=2)
    torch.testing.assert_close(many(wider), few(obs), rtol=1e-12, atol=1e-12)


def test_of_equally_near_ones_the_first_counts() -> None:
    encoder, obs = make(pooling="nearest"), observations()
    victims = victims_of(obs)
    victims[..., PRESENT] = 1.0
    victims[..., VICTIM_PLACE] = torch.tensor([3.0, 4.0], dtype=torch.float64)
    victims[:, :, 1, VICTIM_PLACE] = torch.tensor([-5.0, 0.0], dtype=torch.float64)
    before = encoder(obs)
    victims[:, :, 1:, 0] += 1.0
    assert torch.equal(encoder(obs), before)
    victims[:, :, 0, 0] += 1.0
    assert not torch.isclose(encoder(obs), before).all(dim=2).any()


@pytest.mark.parametrize("lost", ["victim_place", "teammate_place"])
def test_the_nearest_needs_places(lost: str) -> None:
    given = replace(columns(3), **{lost: None})
    with pytest.raises(ValueError, match=r"'nearest' needs the places of entities$"):
        EntityEncoder(3, given, 0, 64, generator(), "nearest")
    EntityEncoder(3, given, 0, 64, generator(), "max")


@pytest.mark.parametrize("pooling", POOLINGS[1:])
def test_poolings_without_queries_have_the_other_parameters_alone(pooling: str) -> None:
    attention, other = make(), make(pooling=pooling)
    shapes = {name: one.shape for name, one in attention.named_parameters()}
    del shapes["query.weight"], shapes["query.bias"]
    assert {name: one.shape for name, one in other.named_parameters()} == shapes


@pytest.mark.parametrize("pooling", POOLINGS)
def test_a_world_without_victims_has_finite_gradients(pooling: str) -> None:
    encoder, obs = make(pooling=pooling), (1e3 * observations()).requires_grad_()
    encoder(obs)[:, :1].square().sum().backward()
    assert obs.grad is not None
    assert obs.grad.isfinite().all()
    assert not victims_of(obs.grad)[:, 0].any()
    for parameter in encoder.parameters():
        assert parameter.grad is None or parameter.grad.isfinite().all()


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
