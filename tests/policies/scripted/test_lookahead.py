"""Plans of `planner` in worlds, beside plain ones and beside `hungarian`."""

from itertools import permutations
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from innerattn import _core
from innerattn.config import Battery, Robot, Scenario, Station, Task
from innerattn.envs import BatchEnv
from innerattn.policies import PolicyInput, WorldState, scripted_policy
from innerattn.policies.scripted.dispatch import PlannerPolicy
from innerattn.policies.scripted.steering import Steering
from innerattn.policies.scripted.timing import Timing

ALONE = Robot(name="medic", kind="medic", abilities=("medicine",), max_speed_mps=1.0, mass_kg=0.5)


def waves(**changed: Any) -> Scenario:
    return Scenario().replace(
        **{"max_victims": 6, "episode_steps": 150, "engine": "discs", **changed}
    )


def with_tasks(scenario: Scenario, **changed: Any) -> Scenario:
    tasks = tuple(task.replace(**changed) for task in scenario.tasks)
    return scenario.replace(tasks=tasks)


def rescues(name: str, scenario: Scenario, worlds: int = 64) -> tuple[int, int]:
    """Victims that were rescued and lost in an episode of each world."""
    policy = scripted_policy(name, scenario)
    env = BatchEnv(scenario, worlds, seed=3, num_threads=1, autoreset="disabled")
    obs, rescued, lost = env.reset(), 0, 0
    for _ in range(scenario.episode_steps):
        step = env.step(policy.act(PolicyInput(obs, WorldState.of(env))))
        obs, rescued, lost = step.obs, rescued + len(step.rescues), lost + len(env.lost())
    return rescued, lost


WORLDS = {
    "waves": waves(),
    "order": waves(tasks=(Scenario().tasks[0].replace(after=("task_2",)), Scenario().tasks[1])),
    "arrivals": with_tasks(
        waves(situation="poisson", max_victims=4),
        arrival_rate_hz=0.5,
        service_s=0.5,
        deadline_s=(2, 6),
    ),
}


@pytest.mark.parametrize("name", WORLDS)
def test_planner_rescues_more_than_hungarian(name: str) -> None:
    (planned, late), (assigned, lost) = (
        rescues(policy, WORLDS[name]) for policy in ("planner", "hungarian")
    )
    assert planned > assigned
    assert late <= lost


def test_planner_is_as_good_as_hungarian_where_nothing_is_to_be_planned() -> None:
    for situation in ("single", "double", "mixed"):
        scenario = waves(situation=situation, max_victims=2)
        assert rescues("planner", scenario)[0] > 0.97 * rescues("hungarian", scenario)[0]


@given(
    at=st.tuples(*[st.floats(-0.9, 0.9)] * 2),
    places=st.lists(st.tuples(*[st.floats(-0.9, 0.9)] * 2), min_size=1, max_size=4),
    situation=st.sampled_from(["poisson", "mixed"]),
)
def test_one_robot_goes_first_where_the_best_tour_begins(
    at: tuple[float, float], places: list[tuple[float, float]], situation: str
) -> None:
    task = Task(name="injured", needs=("medicine",))
    scenario = Scenario(robots=(ALONE,), tasks=(task,), situation=situation, max_victims=4)
    steering = Steering(scenario)
    speed, lag, radius = steering.speed[0], steering.lag[0], scenario.rescue_radius_m

    def takes(way: float) -> float:
        gap = max(way - radius, 0.0)
        return gap / speed + (lag if gap > 0.0 else 0.0)

    def cost(order: tuple[int, ...]) -> float:
        here, now, driven, ends = np.array(at), 0.0, 0.0, []
        for victim in order:
            there = np.array(places[victim])
            leg = takes(float(np.hypot(*(there - here))))
            here, now, driven = there, now + leg, driven + leg
            ends.append(now)
        last, total = ends[-1], sum(ends)
        return (total if situation == "poisson" else last + 0.1 * total) + 0.01 * driven

    orders = list(permutations(range(len(places))))
    costs = [cost(order) for order in orders]
    goal = _goal(scenario, at, places)
    reached = min(value for value, order in zip(costs, orders, strict=True) if order[0] == goal)
    assert reached == pytest.approx(min(costs), abs=1e-6)


def _goal(scenario: Scenario, at: tuple[float, float], places: list[tuple[float, float]]) -> int:
    """The victim that the one robot of a world goes to first."""
    env = BatchEnv(scenario, 1, seed=0, num_threads=1)
    env.reset()
    victims = env.victims()
    victims["present"] = False
    for slot, (x, y) in enumerate(places):
        victims[0, slot] = (True, 0, slot, 0, x, y)
    state = WorldState.of(env)._replace(
        positions=np.array([[at]], np.float32),
        velocities=np.zeros((1, 1, 2), np.float32),
        victims=victims,
    )
    placed = np.stack([victims["x"], victims["y"]], -1).astype(np.float64)
    return int(PlannerPolicy(scenario).choose(state, placed)[0, 0])


def test_plans_of_a_world_do_not_depend_on_the_others() -> None:
    scenario = WORLDS["arrivals"]
    env = BatchEnv(scenario, 24, seed=5, num_threads=1)
    policy, obs = PlannerPolicy(scenario), env.reset()
    for _ in range(30):
        obs = env.step(policy.act(PolicyInput(obs, WorldState.of(env)))).obs
    state = WorldState.of(env)
    actions = policy.act(PolicyInput(obs, state))
    for world in range(24):
        alone = WorldState(*(None if part is None else part[world : world + 1] for part in state))
        own = PlannerPolicy(scenario).act(PolicyInput(obs[world : world + 1], alone))
        assert np.array_equal(own[0], actions[world])


def test_who_comes_before_a_victim_is_who_is_there_in_order() -> None:
    first, second = Scenario().tasks
    scenario = waves(tasks=(first.replace(after=("task_2",)), second), situation="poisson")
    scenario = with_tasks(scenario, arrival_rate_hz=1.0)
    env = BatchEnv(scenario, 16, seed=1, num_threads=1)
    env.reset()
    seen = 0
    for _ in range(30):
        env.step(np.zeros((16, 4), np.int64))
        victims = env.victims()
        bits = Timing(scenario).waits_for(WorldState.of(env))
        for world, slot in np.ndindex(*victims.shape):
            own = victims[world, slot]
            before = [
                other
                for other, one in enumerate(victims[world])
                if own["present"] and one["present"]
                if (own["task"], one["task"]) == (0, 1)
                if one["appeared_step"] <= own["appeared_step"]
            ]
            assert bits[world, slot] == sum(1 << other for other in before)
            assert own["blocked"] == bool(before)
            seen += len(before)
    assert seen > 100


def test_a_victim_that_cannot_be_rescued_in_time_is_left() -> None:
    task = Task(name="injured", needs=("medicine",), deadline_s=(0.5, 9.0), service_s=0.2)
    scenario = Scenario(robots=(ALONE,), tasks=(task,), situation="mixed", max_victims=2)
    env = BatchEnv(scenario, 1, seed=0, num_threads=1)
    env.reset()
    victims, state = env.victims(), WorldState.of(env)
    victims["present"], victims["task"] = True, 0
    victims["x"], victims["y"] = [[0.4, -0.9]], 0.0
    for steps, goal in (((90, 90), 0), ((3, 90), 1), ((3, 3), -1)):
        victims["deadline_step"] = steps
        now = state._replace(
            positions=np.zeros((1, 1, 2), np.float32),
            velocities=np.zeros((1, 1, 2), np.float32),
            victims=victims,
        )
        places = np.stack([victims["x"], victims["y"]], -1).astype(np.float64)
        assert PlannerPolicy(scenario).choose(now, places).tolist() == [[goal]]


def test_batteries_and_stations_are_planned_with() -> None:
    robot = ALONE.replace(battery=Battery(capacity_j=80.0, per_m_j=10.0, idle_w=0.0))
    scenario = Scenario(
        robots=(robot,),
        tasks=(Task(name="injured", needs=("medicine",)),),
        stations=(Station(position_m=(-0.8, 0.0), recharge_w=50.0),),
        situation="single",
        episode_steps=200,
    )
    planned, assigned = (rescues(name, scenario)[0] for name in ("planner", "hungarian"))
    assert planned >= assigned > 64 * 4


DOOR = {
    "positions": (np.zeros((2, 1, 2)), np.zeros((2, 2, 2)), "positions"),
    "charges": (np.zeros((2, 1)), np.zeros((2, 1), np.int64), "charges"),
    "loads": (np.zeros((2, 1), np.int64), np.zeros((2, 1)), "loads"),
    "numbers": (np.zeros((2, 3, 2), np.int64), np.full((2, 3, 2), 1), "numbers"),
    "victims": (np.zeros((2, 3, 4)), np.zeros((2, 3, 3)), "victims"),
}


@pytest.mark.parametrize("name", DOOR)
def test_wrong_arrays_are_refused_at_the_door(name: str) -> None:
    planner = _core.Dispatcher(
        [(1.0, 0.1, None, None, [1.0])], [([0], None)], [], [], 0.1, True, (1, 0), 9
    )
    arrays = {key: good for key, (good, _, _) in DOOR.items()}
    times = np.ones((2, 1, 3))
    assert planner.choose(times=times, **arrays).shape == (2, 1)
    with pytest.raises((TypeError, ValueError), match=DOOR[name][2]):
        planner.choose(times=times, **{**arrays, name: DOOR[name][1]})


def test_victims_that_wait_for_each_other_in_a_circle_are_refused() -> None:
    planner = _core.Dispatcher(
        [(1.0, 0.1, None, None, [1.0])], [([0], None)], [], [], 0.1, True, (1, 0), 9
    )
    numbers = np.array([[[0, 0b10], [0, 0b01]]])
    with pytest.raises(ValueError, match="circle"):
        planner.choose(
            np.zeros((1, 1, 2)),
            np.zeros((1, 1)),
            np.zeros((1, 1), np.int64),
            np.ones((1, 1, 2)),
            numbers,
            np.zeros((1, 2, 4)),
        )
    with pytest.raises(ValueError, match="robots"):
        _core.Dispatcher([], [([0], None)], [], [], 0.1, True, (1, 0), 9)
