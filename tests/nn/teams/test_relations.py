"""Relations of teams against plain loops over robots and victims."""

import math
from collections.abc import Callable, Iterable
from itertools import combinations

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from random_teams import Size, random_tables

from innerattn.config import Scenario
from innerattn.nn.teams import TeamTables, relate
from innerattn.nn.teams.coalitions import NEVER_S
from innerattn.nn.teams.frames import frame_of, turn, turn_back_choices
from innerattn.nn.teams.relations import NEAREST
from innerattn.nn.teams.tables import ENDLESS_S
from innerattn.policies.scripted.steering import Steering

SIZES = st.builds(
    Size,
    worlds=st.integers(1, 4),
    robots=st.integers(1, 6),
    victims=st.integers(1, 4),
    abilities=st.integers(1, 3),
)
COLUMN = {
    "time": 1,
    "met": 5,
    "spare": 7,
    "spare_mine": 8,
    "rank": 14,
    "rival": 17,
    "last": 18,
    "nearer": 20,
    "wait": 23,
    "left": 24,
    "blocked": 25,
    "to_spare": 26,
}


def arrival_time(tables: TeamTables, world: int, robot: int, victim: int) -> float:
    (px, py), (vx, vy) = tables.positions[world, robot], tables.velocities[world, robot]
    x, y = tables.places[world, victim]
    speed, lag = tables.bodies[world, robot, :2].tolist()
    distance = math.hypot(x - px, y - py)
    gap = max(distance - 0.15, 0.0)
    if gap == 0.0:
        return 0.0
    towards = float(vx * (x - px) + vy * (y - py)) / max(distance, 1e-6)
    return min(gap / speed + max(lag * (1.0 - towards / speed), 0.0), 8.0)


def most_filled(robots: list[set[int]], needs: list[int]) -> int:
    """So many needs different robots can fill, by trying all ways to give each robot one."""
    reached = {(0,) * len(needs)}
    for can in robots:
        for given_out in list(reached):
            for k in can:
                if given_out[k] < needs[k]:
                    reached.add((*given_out[:k], given_out[k] + 1, *given_out[k + 1 :]))
    return max(sum(given_out) for given_out in reached)


def by_hand(tables: TeamTables, world: int, victim: int) -> dict[int, dict[str, float]]:
    """What the columns of each robot that can help a victim should say."""
    robots = range(tables.positions.shape[1])
    needs = [int(count) for count in tables.needs[world, victim]]
    able = tables.abilities[world].tolist()
    times = [arrival_time(tables, world, robot, victim) for robot in robots]
    mine = {i: {k for k, count in enumerate(needs) if count and able[i][k]} for i in robots}
    waiting = [v for v in range(tables.places.shape[1]) if tables.is_victim[world, v]]

    def filled(until: float, *, without: int | None = None, beside: int | None = None) -> int:
        there = [mine[j] for j in robots if times[j] <= until and j not in (without, beside)]
        return most_filled([*there, *([mine[beside]] if beside is not None else [])], needs)

    def first(holds: Callable[[float], bool]) -> float:
        return next((t for t in sorted([0.0, *times]) if holds(t)), NEVER_S)

    def slack(sorts: Iterable[int]) -> int:
        able_to = [i for i in robots if mine[i] & set(sorts)]
        return len(able_to) - sum(needs[k] for k in sorts)

    wanted = [k for k, count in enumerate(needs) if count]
    sets = [one for size in range(len(wanted)) for one in combinations(wanted, size + 1)]
    found = {}
    wait, left, blocked = tables.waits[world, victim].tolist()
    complete = first(lambda t: filled(t) == sum(needs))
    for i in robots:
        if not mine[i]:
            continue
        rival = first(lambda t, i=i: filled(t, without=i) == filled(t, beside=i))
        last = first(lambda t, i=i: filled(t, beside=i) == sum(needs))
        useful = [
            v
            for v in waiting
            if any(n and a for n, a in zip(tables.needs[world, v], able[i], strict=True))
        ]
        order = sorted(
            useful,
            key=lambda v: (float(tables.waits[world, v, 2]), arrival_time(tables, world, i, v), v),
        )
        alike = [j for j in robots if j != i and mine[i] & mine[j]]
        found[i] = {
            "time": times[i] / 2.0,
            "met": most_filled([mine[j] for j in robots if times[j] == 0.0], needs) / 3.0,
            "spare": min(max(min(slack(one) for one in sets), -1), 4) / 3.0,
            "spare_mine": min(max(min(slack(o) for o in sets if mine[i] & set(o)), -1), 4) / 3.0,
            "rank": order.index(victim) / 2.0,
            "rival": min(max(rival - times[i], -3.0), 3.0),
            "last": min(last, 4.0),
            "nearer": min(sum(times[j] < times[i] for j in alike), 4) / 3.0,
            "wait": min(wait, 4.0) / 2.0,
            "left": min(left, 8.0) / 4.0,
            "blocked": blocked,
            "to_spare": min(max(left - complete - wait, -3.0), 3.0) if left < ENDLESS_S else 3.0,
        }
    return found


@given(size=SIZES, seed=st.integers(0, 10_000))
def test_columns_are_those_of_plain_loops(size: Size, seed: int) -> None:
    check_columns(random_tables(size, seed))


@given(seed=st.integers(0, 10_000))
def test_columns_of_many_sorts_of_needs(seed: int) -> None:
    check_columns(random_tables(Size(worlds=2, robots=5, victims=1, abilities=6), seed))


def check_columns(tables: TeamTables) -> None:
    seen = relate(tables)
    rows = {}
    for row, (cell, slot) in enumerate(zip(seen.cells.tolist(), seen.slots.tolist(), strict=True)):
        rows[cell] = row
        assert slot == int(seen.robots[row]) * NEAREST + round(float(seen.pairs[row, 14]) * 2)
    expected_cells = set()
    victims = tables.is_victim.nonzero().tolist()
    for number, (world, victim) in enumerate(victims):
        for robot, expected in by_hand(tables, world, victim).items():
            if expected["rank"] * 2.0 >= NEAREST:
                continue
            cell = number * tables.positions.shape[1] + robot
            expected_cells.add(cell)
            found = seen.pairs[rows[cell]]
            for name, value in expected.items():
                assert float(found[COLUMN[name]]) == pytest.approx(value, abs=2e-5), name
    assert set(rows) == expected_cells


@given(size=SIZES, seed=st.integers(0, 10_000))
def test_columns_of_victims_are_those_of_plain_loops(size: Size, seed: int) -> None:
    tables = random_tables(size, seed)
    seen = relate(tables)
    for number, (world, victim) in enumerate(tables.is_victim.nonzero().tolist()):
        needs = [int(count) for count in tables.needs[world, victim]]
        arrivals = sorted(
            (
                arrival_time(tables, world, i, victim),
                {k for k, count in enumerate(needs) if count and able[k]},
            )
            for i, able in enumerate(tables.abilities[world].tolist())
        )

        for column, filled in ((0, sum(needs)), (2, 1)):
            times = [0.0] + [moment for moment, _ in arrivals]
            prefixes = [[mine for _, mine in arrivals[:k]] for k in range(len(times))]
            expected = next(
                (
                    t
                    for t, p in zip(times, prefixes, strict=True)
                    if most_filled(p, needs) >= filled
                ),
                NEVER_S,
            )
            found = float(seen.victims[number, column])
            assert found == pytest.approx(min(expected, 5.0), abs=2e-5)
        of_pairs = seen.pairs[torch.div(seen.cells, size.robots, rounding_mode="floor") == number]
        for row in of_pairs:
            assert torch.equal(row[23:], seen.victims[number, 8:])


@given(size=SIZES, seed=st.integers(0, 10_000))
def test_rivals_and_partners_are_those_of_plain_loops(size: Size, seed: int) -> None:
    tables = random_tables(size, seed)
    seen = relate(tables)
    for number, (world, victim) in enumerate(tables.is_victim.nonzero().tolist()):
        needs = tables.needs[world, victim].tolist()
        fills = [
            {k for k, count in enumerate(needs) if count and able[k]}
            for able in tables.abilities[world].tolist()
        ]
        for i, mine in enumerate(fills):
            for j, other in enumerate(fills):
                rival = i != j and bool(mine & other)
                partner = i != j and most_filled([mine, other], [int(n) for n in needs]) == 2
                assert bool(seen.rivals[number, i, j]) == rival
                assert bool(seen.partners[number, i, j]) == partner


def test_arrival_times_are_those_of_scripts() -> None:
    scenario = Scenario.preset("mixed")
    steering = Steering(scenario)
    tables = random_tables(Size(worlds=50, robots=4, victims=3), 1)
    bodies = torch.tensor(steering.bodies(), dtype=torch.float32).expand(50, -1, -1)
    everywhere = torch.ones_like(tables.is_victim)
    needs = torch.ones_like(tables.needs)
    tables = tables._replace(bodies=bodies, is_victim=everywhere, needs=needs)
    times = steering.arrival_times(
        tables.positions.numpy(), tables.velocities.numpy(), tables.places.numpy()
    )
    found = relate(tables).times.view(50, 3, 4).transpose(1, 2)
    np.testing.assert_allclose(found, times, rtol=1e-4, atol=1e-5)


@given(
    vectors=st.lists(st.tuples(st.floats(-1, 1), st.floats(-1, 1)), min_size=1, max_size=8),
)
def test_frames_bring_vectors_into_one_eighth_and_actions_back(
    vectors: list[tuple[float, float]],
) -> None:
    given_vectors = torch.tensor(vectors)
    frames = frame_of(given_vectors)
    turned = turn(given_vectors, frames)
    assert bool((turned[:, 0] >= turned[:, 1]).all())
    assert bool((turned[:, 1] >= 0.0).all())
    pushes = torch.tensor([[0.0, 0.0], [1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
    # How far each push leads along the vector is the same in the frame and in the world.
    in_frame = turned @ pushes.T
    torch.testing.assert_close(turn_back_choices(in_frame, frames), given_vectors @ pushes.T)
