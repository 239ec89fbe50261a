"""Actor and critic of any team: what must not matter to them does not."""

import pytest
import torch
from random_teams import Size, random_tables
from torch import Tensor

from innerattn.nn.symmetry import NUM_ELEMENTS
from innerattn.nn.teams import (
    POOLINGS,
    TeamActor,
    TeamCritic,
    TeamTables,
    joined_tables,
    relate,
)
from innerattn.nn.teams.frames import turn, turn_back_choices

pytestmark = pytest.mark.parametrize("pooling", POOLINGS)


def networks(pooling: str) -> tuple[TeamActor, TeamCritic]:
    """Networks whose outputs differ, as trained ones' do."""
    torch.manual_seed(7)
    actor, critic = TeamActor(16, pooling, 8), TeamCritic()
    for network in (actor, critic):
        for parameter in network.parameters():
            parameter.data += 0.2 * torch.randn_like(parameter)
    return actor, critic


def outputs(pooling: str, tables: TeamTables) -> tuple[Tensor, Tensor]:
    actor, critic = networks(pooling)
    seen = relate(tables)
    return actor(seen).detach(), critic(seen).detach()


def test_they_are_distributions(pooling: str) -> None:
    log_probs, values = outputs(pooling, random_tables(Size(), 0))
    assert log_probs.shape == (20, 5)
    assert values.shape == (5,)
    torch.testing.assert_close(log_probs.exp().sum(1), torch.ones(20))
    assert float(log_probs.std()) > 0.1  # they do depend on what is seen
    assert float(values.std()) > 0.01


def test_orders_of_robots_victims_and_abilities_do_not_matter(pooling: str) -> None:
    tables = random_tables(Size(worlds=6, robots=5, victims=4, abilities=4), 3)
    robots, victims, abilities = (torch.randperm(count) for count in (5, 4, 4))
    mixed = TeamTables(
        is_robot=tables.is_robot[:, robots],
        is_there=tables.is_there[:, robots],
        positions=tables.positions[:, robots],
        velocities=tables.velocities[:, robots],
        bodies=tables.bodies[:, robots],
        abilities=tables.abilities[:, robots][..., abilities],
        is_victim=tables.is_victim[:, victims],
        places=tables.places[:, victims],
        needs=tables.needs[:, victims][..., abilities],
        waits=tables.waits[:, victims],
        demand=tables.demand[:, abilities],
        worlds=tables.worlds,
    )
    log_probs, values = outputs(pooling, tables)
    other_log_probs, other_values = outputs(pooling, mixed)
    expected = log_probs.view(6, 5, 5)[:, robots].flatten(0, 1)
    torch.testing.assert_close(other_log_probs, expected, atol=1e-4, rtol=1e-4)
    torch.testing.assert_close(other_values, values, atol=1e-4, rtol=1e-4)


def test_larger_teams_beside_it_do_not_matter(pooling: str) -> None:
    small = random_tables(Size(worlds=3, robots=2, victims=1, abilities=2), 4)
    large = random_tables(Size(worlds=4, robots=6, victims=5, abilities=4), 5)
    log_probs, values = outputs(pooling, joined_tables([small, large]))
    for one, rows, worlds in (
        (small, slice(0, 6), slice(0, 3)),
        (large, slice(6, 30), slice(3, 7)),
    ):
        alone, alone_values = outputs(pooling, one)
        torch.testing.assert_close(log_probs[rows], alone, atol=1e-4, rtol=1e-4)
        torch.testing.assert_close(values[worlds], alone_values, atol=1e-4, rtol=1e-4)


@pytest.mark.parametrize("element", range(NUM_ELEMENTS))
def test_a_turned_world_gives_turned_actions(pooling: str, element: int) -> None:
    tables = random_tables(Size(), 6)

    def turned(vectors: Tensor) -> Tensor:
        flat = vectors.reshape(-1, 2)
        return turn(flat, torch.full((len(flat),), element)).view_as(vectors)

    other = tables._replace(
        positions=turned(tables.positions),
        velocities=turned(tables.velocities),
        places=turned(tables.places),
    )
    log_probs, values = outputs(pooling, tables)
    other_log_probs, other_values = outputs(pooling, other)
    back = turn_back_choices(other_log_probs, torch.full((len(other_log_probs),), element))
    torch.testing.assert_close(back, log_probs, atol=1e-4, rtol=1e-4)
    torch.testing.assert_close(other_values, values, atol=1e-4, rtol=1e-4)


def test_every_parameter_learns(pooling: str) -> None:
    actor, critic = networks(pooling)
    seen = relate(random_tables(Size(worlds=30, robots=6, victims=5), 8))
    actor(seen)[:, 1].sum().backward()
    critic(seen).sum().backward()
    for network in (actor, critic):
        for name, parameter in network.named_parameters():
            assert parameter.grad is not None, name
            assert bool((parameter.grad != 0).any()), name
