"""Amounts through `BatchEnv`: who rescues together, and what is seen of them."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from innerattn.config import Scenario
from innerattn.envs import BatchEnv
from innerattn.envs.bounds import observation_bounds

ENVS, STEPS = 8, 50
AMOUNTS = st.sampled_from([0.1, 0.2, 0.7, 1.0, 1.5])


@st.composite
def scenarios(draw: st.DrawFn) -> Scenario:
    """Teams of two to six; the first task needs sums that the team has, the second one a list."""
    body = {"kind": "boat", "max_speed_mps": 1.5, "mass_kg": 1.0}
    team = []
    for index in range(draw(st.integers(2, 6))):
        some: object = draw(
            st.one_of(
                st.dictionaries(st.sampled_from(["rope", "water"]), AMOUNTS),
                st.just(["water"]),
            )
        )
        team.append({"name": f"boat_{index}", "abilities": some, **body})
    team[0] |= {"abilities": {"water": draw(AMOUNTS), "rope": draw(AMOUNTS)}}
    one = Scenario().replace(robots=team, tasks=[{"name": "any", "needs": ["water"]}])
    needs = {
        need: draw(st.sampled_from([0.3, 0.6, 1.0])) * sum(r.amount(need) for r in one.robots)
        for need in draw(st.sampled_from([("water",), ("rope", "water")]))
    }
    return one.replace(
        situation=draw(st.sampled_from(["single", "double", "mixed"])),
        tasks=[{"name": "fire", "needs": needs}, {"name": "flood", "needs": ["water"]}],
        rescue_radius_m=0.7,
        spawn_clearance_m=0.1,
        victim_order=draw(st.sampled_from(["relevant", "slot"])),
    )


@settings(max_examples=40)
@given(worlds=scenarios(), seed=st.integers(0, 2**32), cut=st.integers(0, STEPS - 1))
def test_what_is_seen_and_who_rescues(worlds: Scenario, seed: int, cut: int) -> None:
    env, other = (BatchEnv(worlds, ENVS, seed + n, num_threads=1 + n) for n in (0, 1))
    names, rng = env.observation_names(), np.random.default_rng(seed)
    abilities = sorted({one for robot in worlds.robots for one in robot.abilities})
    low, high = observation_bounds(worlds)
    env.reset()
    for step in range(STEPS):
        if step == cut:
            other.restore(env.snapshot())
        before = env.victims()
        actions = rng.integers(0, 5, (ENVS, worlds.num_robots))
        made = env.step(actions)
        if step >= cut:
            same = other.step(actions)
            assert made.obs.tobytes() == same.obs.tobytes()
            assert made.rescues.tobytes() == same.rescues.tobytes()
        helped: set[tuple[int, int]] = set()
        for row in made.rescues.tolist():
            world, helpers = row[0], [robot for robot in row[6:] if robot >= 0]
            task = worlds.tasks[row[5]]
            assert before["present"][world, row[3]]
            assert len(set(helpers)) == len(helpers)
            for robot in helpers:
                assert (world, robot) not in helped, "it helps two victims in one step"
                helped.add((world, robot))
            if not task.sums:
                assert len(helpers) == 1
                continue
            for left_out in (None, *helpers):
                rest = [worlds.robots[robot] for robot in helpers if robot != left_out]
                met = all(
                    sum(robot.amount(need) for robot in rest) >= amount * (1 - 1e-8)
                    for need, amount in task.sums.items()
                )
                assert met == (left_out is None)
        obs = made.obs
        assert ((low <= obs) & (obs <= high)).all()
        for robot, member in enumerate(worlds.robots):
            given = [np.float32(member.amount(one)) for one in abilities]
            own = [names.index(f"own.ability.{one}") for one in abilities]
            assert (obs[:, robot, own] == given).all()
        if worlds.victim_order == "slot":
            victims = env.victims()
            for slot in range(worlds.num_victims):
                for one in abilities:
                    wanted = np.array([task.amount(one) for task in worlds.tasks], np.float32)
                    seen = obs[:, 0, names.index(f"victim_{slot}.need.{one}")]
                    there = victims["present"][:, slot]
                    assert (seen == np.where(there, wanted[victims["task"][:, slot]], 0)).all()


@pytest.mark.parametrize(("needed", "helpers"), [(0.6, [1]), (1.0, [1, 2]), (2.4, [0, 1, 2])])
def test_the_nearest_that_are_needed_help(needed: float, helpers: list[int]) -> None:
    body = {"kind": "boat", "max_speed_mps": 1.0, "mass_kg": 1.0}
    team = [
        {"name": "far", "abilities": {"water": 1.2}, "start_m": [0.5, 0.0], **body},
        {"name": "near", "abilities": {"water": 0.7}, "start_m": [0.3, 0.0], **body},
        {"name": "next", "abilities": {"water": 0.5}, "start_m": [-0.4, 0.0], **body},
    ]
    worlds = Scenario().replace(
        situation="single",
        robots=team,
        tasks=[{"name": "fire", "needs": {"water": needed}}],
        victim_places_m=[[0.0, 0.0]],
        rescue_radius_m=0.6,
    )
    env = BatchEnv(worlds, 1)
    env.reset()
    (rescue,) = env.step(np.zeros((1, 3), np.int64)).rescues.tolist()
    found = [robot for robot in rescue[6:] if robot >= 0]
    assert sorted(found) == helpers
    assert found == sorted(found, key=[0.5, 0.3, 0.4].__getitem__)
