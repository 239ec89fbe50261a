"""Relations of teams against plain loops over robots and victims."""

import math

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from random_teams import Size, random_tables

from innerattn.config import Scenario
from innerattn.nn.teams import TeamTables, relate
from innerattn.nn.teams.frames import frame_of, turn, turn_back_choices
from innerattn.nn.teams.relations import NEAREST, NEVER_S
from innerattn.policies.scripted.steering import Steering

SIZES = st.builds(
    Size,
    worlds=st.integers(1, 4),
    robots=st.integers(1, 6),
    victims=st.integers(1, 4),
    abilities=st.integers(1, 3),
)
COLUMN = {"time": 1, "met": 5, "spare": 7, "rank": 14, "rival": 17, "last": 18, "nearer": 20}


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


def by_hand(tables: TeamTables, world: int, victim: int) -> dict[int, dict[str, float]]:
    """What the columns of each robot that can help a victim should say."""
    robots = range(tables.positions.shape[1])
    needs = tables.needs[world, victim].tolist()
    able = tables.abilities[world].tolist()
    times = [arrival_time(tables, world, robot, victim) for robot in robots]
    mine = {i: [k for k, count in enumerate(needs) if count and able[i][k]] for i in robots}
    waiting = [v for v in range(tables.places.shape[1]) if tables.is_victim[world, v]]

    def nth_of_others(k: int, count: int, without: int | None) -> float:
        """When the count-th robot with an ability is there, one robot left out."""
        if count < 1:
            return 0.0
        found = sorted(times[j] for j in robots if j != without and k in mine[j])
        return found[count - 1] if count <= len(found) else NEVER_S

    found = {}
    for i in robots:
        if not mine[i]:
            continue
        rival = min(nth_of_others(k, int(needs[k]), i) for k in mine[i])
        last = max(
            nth_of_others(k, int(needs[k]) - 1, i)
            if k in mine[i]
            else nth_of_others(k, int(needs[k]), None)
            for k, count in enumerate(needs)
            if count
        )
        useful = [
            v
            for v in waiting
            if any(n and a for n, a in zip(tables.needs[world, v], able[i], strict=True))
        ]
        order = sorted(useful, key=lambda v: (arrival_time(tables, world, i, v), v))
        alike = [j for j in robots if j != i and set(mine[i]) & set(mine[j])]
        met = sum(
            min(count, sum(times[j] == 0.0 and k in mine[j] for j in robots))
            for k, count in enumerate(needs)
        )
        spare = min(
            sum(k in mine[j] for j in robots) - count for k, count in enumerate(needs) if count
        )
        found[i] = {
            "time": times[i] / 2.0,
            "met": met / 3.0,
            "spare": min(max(spare, -1.0), 4.0) / 3.0,
            "rank": order.index(victim) / 2.0,
            "rival": min(max(rival - times[i], -3.0), 3.0),
            "last": min(last, 4.0),
            "nearer": sum(times[j] < times[i] for j in alike) / 3.0,
        }
    return found


@given(size=SIZES, seed=st.integers(0, 10_000))
def test_columns_are_those_of_plain_loops(size: Size, seed: int) -> None:
    tables = random_tables(size, seed)
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
            cell = number * size.robots + robot
            expected_cells.add(cell)
            found = seen.pairs[rows[cell]]
            for name, value in expected.items():
                assert float(found[COLUMN[name]]) == pytest.approx(value, abs=2e-5), name
    assert set(rows) == expected_cells


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
                shared = mine & other
                rival = i != j and bool(shared)
                twice = any(needs[k] > 1 for k in shared)
                partner = i != j and bool(mine) and bool(other) and (not shared or twice)
                assert bool(seen.rivals[number, i, j]) == rival
                assert bool(seen.partners[number, i, j]) == partner


def test_arrival_times_are_those_of_scripts() -> None:
    scenario = Scenario.preset("mixed")
    steering = Steering(scenario)
    tables = random_tables(Size(worlds=50, robots=4, victims=3), 1)
    bodies = np.stack([steering.speed, steering.lag, np.ones(4)], -1)
    bodies = torch.tensor(bodies, dtype=torch.float32).expand(50, -1, -1)
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
