"""Coalitions against a plain loop over robots, and scripts that make them."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from innerattn.config import Scenario
from innerattn.envs import BatchEnv
from innerattn.evaluate.play import run_episodes
from innerattn.policies import WorldState, scripted_policy
from innerattn.policies.scripted.assignment import Needs
from innerattn.policies.scripted.coalitions import Coalitions

BODY = {"kind": "boat", "max_speed_mps": 1.0, "mass_kg": 1.0}
VICTIM = np.dtype([("present", "?"), ("task", "i8"), ("x", "f4"), ("y", "f4")])


def scenario(given: list[dict[str, int]], needs: list[object]) -> Scenario:
    """Amounts in quarters, so that no sum is rounded."""
    robots = [
        {"name": f"boat_{i}", "abilities": {k: v / 4 for k, v in one.items()}, **BODY}
        for i, one in enumerate(given)
    ]
    tasks = [{"name": f"task_{i}", "needs": one} for i, one in enumerate(needs)]
    return Scenario().replace(
        robots=robots, tasks=tasks, situation="double", arena_half_width_m=3.0
    )


def coalition(worlds: Scenario, task: int, times: np.ndarray, free: list[int]) -> list[int]:
    """Who is there soonest until the sums are reached, without those not needed."""

    def reached(team: list[int]) -> bool:
        return all(
            sum(worlds.robots[robot].amount(need) for robot in team) >= amount
            for need, amount in worlds.tasks[task].sums.items()
        )

    able = [r for r in free if any(worlds.robots[r].amount(n) for n in worlds.tasks[task].sums)]
    able.sort(key=lambda robot: (times[robot], robot))
    for count in range(1, len(able) + 1):
        team = able[:count]
        if reached(team):
            for robot in reversed(able[:count]):
                rest = [other for other in team if other != robot]
                team = rest if reached(rest) else team
            return team
    return []


AMOUNTS = st.dictionaries(st.sampled_from(["rope", "water"]), st.integers(1, 6), min_size=1)


@settings(max_examples=150)
@given(
    st.lists(AMOUNTS, min_size=1, max_size=6), st.integers(1, 3), st.integers(0, 2**32), st.data()
)
def test_coalitions_are_those_of_a_plain_loop(
    given: list[dict[str, int]], victims: int, seed: int, data: st.DataObject
) -> None:
    needs: list[object] = []
    for _ in range(victims):
        some = data.draw(st.sampled_from(sorted({one for robot in given for one in robot})))
        most = sum(robot.get(some, 0) for robot in given)
        needs.append({some: data.draw(st.integers(1, most)) / 4})
    worlds, rng = scenario(given, needs), np.random.default_rng(seed)
    times = rng.integers(0, 6, (1, len(given), victims)).astype(np.float64)
    table = np.zeros((1, victims), VICTIM)
    table["present"], table["task"] = rng.random(victims) < 0.8, np.arange(victims)
    state = WorldState(*[np.zeros((1, len(given), 2), np.float32)] * 2, table, None, np.zeros(1))  # type: ignore[arg-type]
    permitted = Needs(worlds).permitted(table["present"], table["task"])
    coalitions = Coalitions(worlds)

    alone = coalitions.alone(state, times, permitted)[0]
    everyone = list(range(len(given)))
    for slot in range(victims):
        team = coalition(worlds, slot, times[0, :, slot], everyone)
        team = team if table["present"][0, slot] else []
        assert np.flatnonzero(alone[:, slot].any(-1)).tolist() == sorted(team)
        assert (alone[:, slot].sum(0) <= 1).all(), "two robots for one place"

    open_ = [slot for slot in range(victims) if table["present"][0, slot]]
    free, wanted = set(everyone), {}
    while open_:
        teams = {s: coalition(worlds, s, times[0, :, s], sorted(free)) for s in open_}
        made = {s: team for s, team in teams.items() if team}
        if not made:
            break
        first = min(made, key=lambda s: (max(times[0, robot, s] for robot in made[s]), s))
        wanted[first] = made[first]
        free -= set(made[first])
        open_.remove(first)
    for slot in open_:
        wanted[slot] = [
            r for r in coalition(worlds, slot, times[0, :, slot], everyone) if r in free
        ]
    shared, needed, short = coalitions.shared(state, times, permitted, permitted.any(1))
    for slot in range(victims):
        members = np.flatnonzero(shared[0, :, slot].any(-1)).tolist()
        assert members == sorted(wanted.get(slot, []))
        assert needed[0, slot].sum() == len(members)
        assert short[0, slot] == (slot in open_)


def boats(count: int, needed: float, **more: object) -> Scenario:
    given = [{"water": 5}] * count
    return scenario(given, [{"water": needed}, ["water"]]).replace(**more)


@pytest.mark.parametrize("name", ["greedy", "hungarian", "oracle"])
def test_scripts_rescue_what_takes_several(name: str) -> None:
    worlds = boats(5, 3.0, episode_steps=100, rescue_radius_m=0.3)
    record = run_episodes(scripted_policy(name, worlds), worlds, 20, 20)
    for task in (0, 1):
        assert (record.rescues["task"] == task).sum() > 20, task
    none = run_episodes(scripted_policy("random", worlds), worlds, 20, 20)
    assert len(record.rescues) > 3 * len(none.rescues)


def test_no_more_go_than_are_needed() -> None:
    worlds = boats(5, 2.5, victim_order="slot")
    env = BatchEnv(worlds, 32)
    env.reset()
    policy = scripted_policy("hungarian", worlds)
    table = env.victims()
    state = WorldState(
        env.positions(), env.velocities(), table, env.fault_state(), env.step_counts()
    )
    at = np.stack([table["x"], table["y"]], -1).astype(np.float64)
    chosen = policy.choose(state, at)  # type: ignore[attr-defined]
    assert ((chosen == 0).sum(1) == 2).all()
    assert ((chosen == 1).sum(1) == 1).all()


def test_the_oracle_leaves_out_who_is_never_there() -> None:
    faults = [{"robot": f"boat_{i}", "kind": "unavailable", "value": 1.0} for i in range(2)]
    worlds = boats(4, 3.75, faults=faults, episode_steps=60)
    record = run_episodes(scripted_policy("oracle", worlds), worlds, 10, 10)
    assert not (record.rescues["task"] == 0).any(), "three of four boats are needed"
    assert (record.rescues["task"] == 1).sum() > 10
