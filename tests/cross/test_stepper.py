"""Worlds of many scenarios against the plain stepper, wherever nothing touches."""

from collections import Counter

import numpy as np
import pytest
from stepper import Stepper, distances

from innerattn.config import Obstacle, Robot, Scenario, Task
from innerattn.envs import BatchEnv
from innerattn.evaluate.dispatch import GreedyPolicy, RandomPolicy
from innerattn.evaluate.episodes import View

TOLERANCE = 1e-6
MARGIN_M = 0.005
SCENARIOS = 48
BIG_TEAMS = (16, 33, 64)


def pick(rng: np.random.Generator, *values: object) -> object:
    return values[rng.integers(len(values))]


def random_team(rng: np.random.Generator, size: int) -> tuple[Robot, ...]:
    names = np.array(["water", "air", "rope", "light"])
    return tuple(
        Robot(
            name=f"robot_{index}",
            kind="any",
            abilities=tuple(names[rng.random(4) < 0.5]) if index else ("air", "rope"),
            max_speed_mps=rng.uniform(0.5, 3.0),
            mass_kg=rng.uniform(0.3, 3.0),
            radius_m=rng.uniform(0.005, 0.03),
            drive_force_n=rng.uniform(1.0, 10.0),
        )
        for index in range(size)
    )


def random_tasks(rng: np.random.Generator, team: tuple[Robot, ...]) -> tuple[Task, ...]:
    """Tasks whose needs robots drawn from the team could fill; needs repeat often."""
    tasks = []
    while len(tasks) < rng.integers(1, 5):
        chosen = rng.permutation(len(team))[: rng.integers(1, 5)]
        needs = [pick(rng, *team[r].abilities) for r in chosen if team[r].abilities]
        if needs:
            tasks.append(Task(name=f"task_{len(tasks)}", needs=needs))
    return tuple(tasks)


def random_scenario(number: int) -> Scenario:
    rng = np.random.default_rng(number)
    size = BIG_TEAMS[number] if number < len(BIG_TEAMS) else int(rng.integers(1, 8))
    team = random_team(rng, size)
    half = max(1.0, 0.6 * size**0.5) * rng.uniform(1.0, 1.5)
    obstacles = (
        Obstacle(shape="disc", radius_m=0.1),
        Obstacle(shape="box", half_extents_m=(0.2, 0.1), position_m=(0.4, -0.3)),
    )
    return Scenario(
        situation=("single", "double", "mixed")[number % 3],
        robots=team,
        tasks=random_tasks(rng, team),
        max_victims=rng.integers(1, 7),
        obstacles=obstacles if rng.random() < 0.25 else (),
        arena_half_width_m=half,
        rescue_radius_m=rng.uniform(0.2, 0.6) * half,
        spawn_clearance_m=rng.uniform(0, 0.1),
        episode_steps=rng.integers(10, 30),
        end_when_rescued=pick(rng, None, 3),
        dt_s=rng.uniform(0.03, 0.15),
        damping=pick(rng, 0.0, 0.25, 0.6, 1.0),
        actions=pick(rng, "discrete", "continuous"),
        rescue_credit=pick(rng, "helpers", "team"),
        rescue_reward=rng.uniform(-1.0, 3.0),
        shaping=("progress", "potential", "none", "potential")[number // 3 % 4],
        shaping_weight=rng.uniform(-1.0, 2.0),
        shaping_discount=rng.uniform(0.8, 1.0),
        contact_cost=1.0,
        action_cost=rng.uniform(0.0, 0.5),
        victim_order=pick(rng, "relevant", "relevant", "slot"),
    )


def seen_victims(env: BatchEnv) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    victims = env.victims()
    places = np.stack([victims["x"], victims["y"]], -1).astype(float)
    return victims, places, np.where(victims["present"], victims["task"], -1)


def unclear_rescue(model: Stepper, distance: np.ndarray, tasks: np.ndarray) -> np.ndarray:
    """(E,) worlds where float32 may see another robot nearer, or within reach, than float64."""
    error = 4 * TOLERANCE * model.scenario.arena_half_width_m
    there = np.where((tasks >= 0)[:, :, None], distance, 1e9 * np.arange(1, distance.shape[2] + 1))
    edge = (abs(there - model.scenario.rescue_radius_m) < error).any((1, 2))
    return edge | (np.diff(np.sort(there, axis=-1), axis=-1) < error).any((1, 2))


def unclear_order(model: Stepper, distance: np.ndarray, tasks: np.ndarray) -> np.ndarray:
    error = 4 * TOLERANCE * model.scenario.arena_half_width_m
    slots = 1e9 * np.arange(1, tasks.shape[1] + 1)[:, None]
    there = np.where((tasks >= 0)[:, :, None], distance, slots)
    return (np.diff(np.sort(there, axis=1), axis=1) < error).any((1, 2))


def assert_near(found: np.ndarray, wanted: np.ndarray, scale: np.ndarray | float) -> None:
    error = abs(found - wanted) / scale
    worst = np.unravel_index(error.argmax(), error.shape)
    assert error[worst] <= TOLERANCE, (worst, found[worst], wanted[worst])


def check_victims(model: Stepper, before: np.ndarray, after: np.ndarray, gone: set[int]) -> None:
    """One world's slots: who stayed, who was replaced, and when a new wave may come."""
    situation, slots = model.scenario.situation, range(len(before))
    new = {s for s in slots if after["present"][s] and after["id"][s] not in before["id"]}
    stay = {s for s in slots if before["present"][s]} - gone
    assert all(before[s] == after[s] for s in stay)
    if situation == "mixed":
        assert bool(new) == (not stay)
        assert {s for s in slots if after["present"][s]} == stay | new
    else:
        assert new == gone
        assert after["present"].all()
    if situation == "double":
        assert after["task"].tolist() == before["task"].tolist()


def check_step(env: BatchEnv, model: Stepper, policy: object, obs: np.ndarray, tally: Counter):
    scenario = model.scenario
    positions, velocities = (a.astype(float) for a in (env.positions(), env.velocities()))
    victims, places, tasks = seen_victims(env)
    steps, obstacles = env.step_counts(), env.obstacles().astype(float)
    actions = policy.act(View(obs, env.positions(), env.velocities(), victims))
    result = env.step(actions)

    drive = model.drive(actions)
    flown, speeds = model.fly(positions, velocities, drive)
    far = distances(flown, places)
    ok = ~model.may_touch(positions, flown, obstacles, MARGIN_M)
    assert_near(env.positions()[ok], flown[ok], scenario.arena_half_width_m)
    assert_near(env.velocities()[ok], speeds[ok], np.maximum(1.0, model.top)[:, None])

    events: dict[int, list] = {}
    for event in result.rescues:
        helpers = [int(event[f"helper_{k}"]) for k in range(len(model.needs[event["task"]]))]
        events.setdefault(int(event["env"]), []).append((int(event["slot"]), tuple(helpers)))
        victim = victims[event["env"], event["slot"]]
        assert (event["victim"], event["task"]) == (victim["id"], victim["task"])
        assert event["step"] == steps[event["env"]]
    ok &= ~unclear_rescue(model, far, tasks)
    settled = [model.settle(far[w], tasks[w]) if ok[w] else [] for w in range(len(far))]
    for world in np.flatnonzero(ok):
        assert events.get(world, []) == settled[world]

    after, new_places, new_tasks = seen_victims(env)
    for world in np.flatnonzero(ok & ~result.terminated):
        check_victims(model, victims[world], after[world], {slot for slot, _ in settled[world]})
    far_now = distances(flown, new_places)
    ways = (
        model.way_to_go(distances(positions, places), tasks),
        model.way_to_go(far, tasks),
        model.way_to_go(far_now, new_tasks),
    )
    wanted = model.rewards(drive, settled, ways, result.terminated)
    scale = 1.0 + sum(ways)[ok, None, None] * abs(scenario.shaping_weight)
    assert_near(env.reward_components()[ok], wanted[ok], scale)
    assert_near(result.reward[ok], wanted[ok].sum(-1), scale[..., 0])
    assert (result.truncated == (steps + 1 == scenario.episode_steps)).all()

    clear = ok & ~unclear_order(model, far_now, new_tasks)
    wanted_obs = model.observations(flown, speeds, new_places, new_tasks)
    unit = 2.0 * np.maximum(scenario.arena_half_width_m, model.top.max())
    assert_near(result.obs[clear], wanted_obs[clear], unit)

    tally["worlds"] += clear.sum()
    tally["robots"] += clear.sum() * env.num_robots
    counts = [(world, event) for world in np.flatnonzero(ok) for event in settled[world]]
    tally["rescues"] += len(counts)
    tally["by several"] += sum(len(helpers) > 1 for _, (_, helpers) in counts)
    tally["with a choice"] += sum(
        (far[world, slot] <= scenario.rescue_radius_m).sum() > len(helpers)
        for world, (slot, helpers) in counts
    )
    tally["at once"] += sum(len(settled[world]) > 1 for world in np.flatnonzero(ok))
    tally["terminated"] += (result.terminated & ok).sum()
    return result


def total_rescues(total: np.ndarray, result: object) -> np.ndarray:
    return total + np.bincount(result.rescues["env"], minlength=len(total))


def test_worlds_equal_the_plain_stepper() -> None:
    tally: Counter = Counter()
    for number in range(SCENARIOS):
        scenario = random_scenario(number)
        big = scenario.num_robots > 10
        model = Stepper(scenario)
        policy = (GreedyPolicy if number % 2 else RandomPolicy)(scenario)
        with BatchEnv(
            scenario, 16 if big else 88, seed=number, num_threads=1, autoreset="disabled"
        ) as env:
            assert env.observation_names() == model.names()
            obs, total = env.reset(), np.zeros(env.num_envs, int)
            for _ in range(12 if big else 32):
                result = check_step(env, model, policy, obs, tally)
                total = total_rescues(total, result)
                goal = scenario.end_when_rescued
                assert (result.terminated == (total >= (goal or 10**9))).all()
                over = result.terminated | result.truncated
                total[over] = 0
                obs = env.reset(mask=over)
    assert tally["worlds"] >= 100_000, tally
    assert tally["rescues"] >= 4_000, tally
    assert min(tally["by several"], tally["with a choice"]) >= 1_000, tally
    assert min(tally["at once"], tally["terminated"]) >= 200, tally


GRID_M = 1 / 16
TIED = Scenario(
    robots=tuple(
        Robot(
            name=f"robot_{index}",
            kind="any",
            abilities=abilities,
            max_speed_mps=1.0,
            mass_kg=1.0,
            radius_m=0.005,
        )
        for index, abilities in enumerate(
            [("a",), ("b",), ("a", "b"), ("a", "c"), ("b", "c"), ("a", "b", "c"), ("c",), ()] * 2
        )
    ),
    tasks=(
        Task(name="pair", needs=("a", "a")),
        Task(name="chain", needs=("a", "b", "c")),
        Task(name="crowd", needs=("c", "a", "c", "b", "a")),
    ),
    max_victims=8,
    rescue_radius_m=2 * GRID_M,
    spawn_clearance_m=0.0,
    wall_clearance_m=0.2,
)


@pytest.mark.parametrize("seed", range(4))
def test_exact_ties_are_settled_by_the_rule(seed: int) -> None:
    """Robots at rest on a grid around a victim: many equally far, some just at the radius."""
    rng = np.random.default_rng(seed)
    model = Stepper(TIED)
    ties = edges = several = rescues = 0
    with BatchEnv(TIED, 500, seed=seed, num_threads=1, autoreset="disabled") as env:
        env.reset()
        _, places, tasks = seen_victims(env)
        centre_slot = np.argmax(tasks >= 0, axis=1)
        centre = places[np.arange(len(places)), centre_slot]
        cells = np.stack(np.meshgrid(*[np.arange(-2, 3)] * 2), -1).reshape(-1, 2) * GRID_M
        offsets = np.stack([rng.permutation(cells)[: env.num_robots] for _ in range(len(places))])
        # A world counts where float32 holds the sums exactly, so that ties are ties.
        positions = (centre[:, None] + offsets).astype(np.float32)
        exact = (positions - centre[:, None] == offsets).all((1, 2))
        env.set_motion(positions, np.zeros_like(positions))
        result = env.step(np.zeros(positions.shape[:2], int))
        assert (env.positions()[exact] == positions[exact]).all()
        far = distances(positions.astype(float), places)
        for world in np.flatnonzero(exact):
            wanted = model.settle(far[world], tasks[world])
            found = result.rescues[result.rescues["env"] == world]
            assert found["slot"].tolist() == [slot for slot, _ in wanted]
            for event, (slot, helpers) in zip(found, wanted, strict=True):
                named = [event[f"helper_{k}"] for k in range(5)]
                assert named == [*helpers, *[-1] * (5 - len(helpers))]
                chosen = far[world, slot, list(helpers)]
                rest = np.delete(far[world, slot], list(helpers))
                ties += bool(np.isin(rest, chosen).any())
                edges += bool((chosen == TIED.rescue_radius_m).any())
            rescues += len(wanted)
            several += len(wanted) > 1
    assert exact.sum() >= 100, exact.sum()
    assert min(ties, edges) >= 30, (rescues, ties, edges, several)
    assert several >= 5
