"""Plain features: they say nothing of times and of what follows from them."""

import torch
from random_teams import Size, random_tables

from innerattn.nn.teams import Relations, TeamActor, TeamTables, relate
from innerattn.nn.teams.features import WORKED_OUT, plain

SIZE = Size(worlds=8, robots=5, victims=4, abilities=3)
LAG, KEPT, MOST_SPEED, REACH = 1, 3, 4, 5
"""Columns of bodies that only arrival times and gains of actions follow from."""


def changed(seen: Relations, other: Relations, name: str) -> set[int]:
    """The columns of a table that differ."""
    differ = getattr(seen, name) != getattr(other, name)
    return set(differ.any(0).nonzero().squeeze(1).tolist())


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
    actor = TeamActor(16, "inner", 8, plain_features=True)
    actor.out.weight.data *= 50.0
    seen = relate(random_tables(SIZE, 5))
    hidden = actor(seen).detach()
    actor.plain_features = False
    torch.testing.assert_close(actor(seen).detach(), hidden)
    actor.first.weight.data[:, 1] = 1.0
    assert float((actor(seen).detach() - hidden).abs().max()) > 0.01
