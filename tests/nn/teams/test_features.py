"""What networks are kept from knowing: what is worked out, and bodies."""

import pytest
import torch
from random_teams import Size, random_tables

from innerattn.nn.teams import Relations, TeamActor, TeamTables, relate
from innerattn.nn.teams.features import BODIES, WORKED_OUT, Bodies, hidden_columns, without
from innerattn.nn.teams.layers import BodyLayer

SIZE = Size(worlds=8, robots=5, victims=4, abilities=3)
LAG, KEPT, MOST_SPEED, REACH = 1, 3, 4, 5
"""Columns of bodies that only arrival times and gains of actions follow from."""


def changed(seen: Relations, other: Relations, name: str) -> set[int]:
    """The columns of a table that differ."""
    differ = getattr(seen, name) != getattr(other, name)
    return set(differ.any(0).nonzero().squeeze(1).tolist())


def plain(seen: Relations) -> Relations:
    return without(seen, WORKED_OUT)


def with_other_motion(tables: TeamTables) -> TeamTables:
    """The same places and bodies, moved by another law."""
    bodies = tables.bodies.clone()
    bodies[..., [LAG, KEPT, MOST_SPEED, REACH]] *= 1.7
    return tables._replace(bodies=bodies)


def test_plain_pairs_do_not_follow_from_the_law_of_motion() -> None:
    tables = random_tables(SIZE, 1)
    seen, other = (relate(one) for one in (tables, with_other_motion(tables)))
    assert torch.equal(seen.cells, other.cells)  # fewer victims than a robot looks at
    for name, kept in {"pairs": set(), "turning": set(), "homes": {1}, "team": {1}}.items():
        assert changed(plain(seen), plain(other), name) == kept
        assert changed(seen, other, name) > kept
    for name in ("victims", "worlds"):
        assert not changed(plain(seen), plain(other), name)
    assert changed(seen, other, "victims")


def test_plain_pairs_do_not_follow_from_how_fast_others_are() -> None:
    tables = random_tables(SIZE, 2)
    bodies = tables.bodies.clone()
    bodies[:, 1:, 0] *= 0.4  # all but the first robot of each world
    seen, other = (relate(one) for one in (tables, tables._replace(bodies=bodies)))
    first = seen.robots % SIZE.robots == 0
    assert torch.equal(plain(seen).pairs[first], plain(other).pairs[first])
    assert not torch.equal(seen.pairs[first], other.pairs[first])


def test_plain_robots_do_not_know_how_much_their_abilities_are_asked_for() -> None:
    tables = random_tables(SIZE, 3)
    seen, other = (relate(one) for one in (tables, tables._replace(demand=tables.demand * 3.0)))
    assert changed(seen, other, "homes") == {8, 9}
    assert not changed(plain(seen), plain(other), "homes")
    assert not changed(plain(seen), plain(other), "team")


def test_all_other_columns_stay() -> None:
    seen = relate(random_tables(SIZE, 4))
    for name, columns in WORKED_OUT.items():
        table, found = getattr(seen, name), getattr(plain(seen), name)
        kept = [column for column in range(table.shape[1]) if column not in columns]
        assert torch.equal(found[:, kept], table[:, kept])
        assert not bool(found[:, list(columns)].any())
        assert bool(table[:, list(columns)].any(0).all())  # each says something in these worlds


def test_an_actor_needs_no_mask_if_it_is_given_all() -> None:
    """Its weights of hidden columns are 0, so that an export need not know of them."""
    torch.manual_seed(5)
    actor = TeamActor(16, "inner", 8, features="plain", bodies="hidden")
    actor.out.weight.data *= 50.0
    seen = relate(random_tables(SIZE, 5))
    hidden = actor(seen).detach()
    actor.hidden = {}
    torch.testing.assert_close(actor(seen).detach(), hidden)
    for column in (WORKED_OUT["pairs"][0], BODIES["pairs"][0]):
        kept = actor.first.weight.data.clone()
        actor.first.weight.data[:, column] = 1.0
        assert float((actor(seen).detach() - hidden).abs().max()) > 0.01
        actor.first.weight.data = kept


def test_all_is_seen_where_nothing_is_hidden() -> None:
    seen = relate(random_tables(SIZE, 6))
    assert without(seen, hidden_columns("all", "told")) is seen


@pytest.mark.parametrize(("bodies", "knows"), [("told", True), ("hidden", False)])
def test_hidden_bodies_change_nothing(bodies: Bodies, knows: bool) -> None:
    """Where robots stand still, what they do shows nothing of how fast they are."""
    tables = random_tables(SIZE, 7)
    tables = tables._replace(velocities=torch.zeros_like(tables.velocities))
    slower = tables.bodies.clone()
    slower[..., :3] *= 0.5  # all of them alike, so that the order of arrivals stays
    torch.manual_seed(8)
    actor = TeamActor(16, "uniform", 8, features="plain", bodies=bodies)
    actor.out.weight.data *= 50.0
    both = (tables, tables._replace(bodies=slower))
    one, other = (actor(relate(each)).detach() for each in both)
    assert (float((one - other).abs().max()) > 1e-4) is knows


def test_a_hypernetwork_gives_each_robot_the_weights_of_its_body() -> None:
    torch.manual_seed(9)
    made = BodyLayer(4, 2, 1.0)
    made.made.weight.data *= 30.0
    bodies, rows = torch.rand(3, 3), torch.rand(5, 4)
    robots = torch.tensor([0, 2, 2, 1, 0])
    expected = []
    for row, robot in zip(rows, robots.tolist(), strict=True):
        hidden = (made.body.weight @ bodies[robot] + made.body.bias).clamp(min=0.0)
        numbers = (made.made.weight @ hidden + made.made.bias).view(2, 5)
        expected.append(numbers[:, :4] @ row + numbers[:, 4])
    torch.testing.assert_close(made(rows, robots, bodies), torch.stack(expected))


def test_only_its_own_body_makes_a_robots_last_layer() -> None:
    tables = random_tables(SIZE, 10)
    tables = tables._replace(velocities=torch.zeros_like(tables.velocities))
    bodies = tables.bodies.clone()
    bodies[:, 1:, 1] *= 3.0  # all but the first robot of each world
    torch.manual_seed(11)
    actor = TeamActor(16, "uniform", 8, features="plain", bodies="hypernetwork")
    actor.out.made.weight.data *= 100.0
    both = (tables, tables._replace(bodies=bodies))
    one, other = (actor(relate(each)).detach() for each in both)
    changed = (one - other).abs().amax(1) > 1e-4
    first = torch.arange(len(changed)) % SIZE.robots == 0
    assert not bool(changed[first].any())
    assert bool(changed[~first].any())
