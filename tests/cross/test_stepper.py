"""The compiled worlds against the plain stepper, transition by transition."""

from collections import Counter
from collections.abc import Callable

import numpy as np
import pytest
from casting import check_rays, ray_columns
from hearing import check_hearing
from seeing import check_sight
from stepper import State, Stepper
from teams import (
    random_scenario,
    with_amounts,
    with_areas,
    with_arrivals,
    with_batteries,
    with_communication,
    with_layers,
    with_list,
    with_loads,
    with_map,
    with_order,
    with_rays,
    with_sight,
    with_times,
    with_wheels,
)
from touching import may_touch
from who_appears import EXACT, check_arrivals, check_victims

from innerattn.config import Scenario, Task
from innerattn.envs import BatchEnv

CHUNKS = 8
LEAST = 104_000
"""Transitions of all chunks together."""
PARTS = [
    0,
    *(pytest.param(n, marks=pytest.mark.long) for n in (1, 2, 3)),
    *(pytest.param(n, marks=pytest.mark.slow) for n in range(4, CHUNKS)),
]
THIRDS = [0, *(pytest.param(n, marks=pytest.mark.slow) for n in (1, 2))]
"""Chunks of 8,000 transitions; two of three are for `make test-slow`."""


def in_boxes(scenario: Scenario) -> Scenario:
    """The same with an obstacle in place of each box of the map."""
    boxes = scenario.map_boxes
    return scenario.replace(map=None, obstacles=(*scenario.obstacles, *boxes))


def state_of(env: BatchEnv) -> State:
    boxes = np.array([box.position_m for box in env.scenario.map_boxes]).reshape(-1, 2)
    boxes = np.broadcast_to(boxes, (env.num_envs, *boxes.shape))
    return State(
        env.positions().astype(np.float64),
        env.velocities().astype(np.float64),
        np.concatenate([env.obstacles().astype(np.float64), boxes], axis=1),
        env.victims(),
        env.fault_state(),
        env.step_counts(),
        env.charge().astype(np.float64),
        env.load().astype(np.float64),
        env.last_seen(),
        env.headings().astype(np.float64),
        env.turn_rates().astype(np.float64),
        env.heard(),
    )


def assert_close(found: np.ndarray, wanted: np.ndarray, what: str, scale: float = 1.0) -> None:
    if not (abs(found - wanted) <= EXACT * scale).all():  # quicker than what words it
        np.testing.assert_allclose(found, wanted, rtol=0, atol=EXACT * scale, err_msg=what)


def random_actions(rng: np.random.Generator, scenario: Scenario, state: State) -> np.ndarray:
    """Half of the robots wander, half head for some victim, so that there are rescues.

    Those whose load is used up head for a depot, if there is one.
    """
    shape = state.positions.shape[:2]
    slot = rng.integers(state.victims.shape[1], size=shape)
    goal = np.take_along_axis(state.places, slot[..., None], axis=1) - state.positions
    toward = rng.random(shape) < 0.5
    for depot in scenario.depots[:1]:
        used_up = state.load == 0
        goal = np.where(used_up[..., None], depot.position_m - state.positions, goal)
        toward |= used_up
    cos, sin = np.cos(state.headings), np.sin(state.headings)  # 1 and 0 without wheels
    x, y = goal[..., 0], goal[..., 1]
    goal = np.stack([cos * x + sin * y, cos * y - sin * x], -1)
    if scenario.actions == "continuous":
        wander = rng.uniform(-1, 1, (*shape, 2))
        return np.where(toward[..., None], np.clip(3 * goal, -1, 1), wander).astype(np.float32)
    along_x = abs(goal[..., 0]) > abs(goal[..., 1])
    wanted = np.where(along_x, 1 + (goal[..., 0] < 0), 3 + (goal[..., 1] < 0))
    return np.where(toward, wanted, rng.integers(0, 5, shape))


def random_faults(rng: np.random.Generator, healthy: np.ndarray) -> np.ndarray:
    """Faults of each kind that needs no random numbers, each for some of the robots."""
    faults = healthy.copy()
    draws = {
        "motor_gain": rng.uniform(0, 1, faults.shape),
        "speed_limit": rng.uniform(0, 1, faults.shape),
        "heading_bias": rng.uniform(-np.pi, np.pi, faults.shape),
        "blackout": np.ones(faults.shape),
        "unavailable": np.ones(faults.shape),
        "lost_communication": np.ones(faults.shape),
    }
    for kind, values in draws.items():
        faults[kind] = np.where(rng.random(faults.shape) < 0.2, values, faults[kind])
    return faults


def compare(scenario: Scenario, seed: int, transitions: int, faulty: bool = False) -> Counter[str]:
    """Steps worlds of one scenario and compares every transition; counts what was seen.

    If ``faulty``, every world meets new faults now and then.
    """
    rng = np.random.default_rng(seed)
    robots = len(scenario.robots)
    num_envs = max(4, 256 // robots)
    env = BatchEnv(scenario, num_envs, seed=seed, num_threads=1, autoreset="disabled")
    plain = Stepper(in_boxes(scenario))
    seen: Counter[str] = Counter()
    env.reset()
    healthy = env.fault_state()
    given = env.victims()["present"].sum(1)
    if scenario.has_arrivals:
        start = env.victims()
        check_arrivals(plain, env, start, np.zeros(start.shape, bool), np.zeros(num_envs, int))
    rescued = np.zeros(num_envs, dtype=int)
    for _ in range(-(-transitions // num_envs)):
        if faulty:
            env.set_faults(random_faults(rng, healthy), mask=rng.random(num_envs) < 0.2)
        before = state_of(env)
        steps = env.step_counts()
        actions = random_actions(rng, scenario, before)
        result = env.step(actions)
        after = state_of(env)
        drive = plain.drive(actions)

        positions, velocities = plain.fly(before, drive)
        free = ~may_touch(plain, before, velocities)
        assert_close(after.positions[free], positions[free], "positions")
        assert_close(after.velocities[free], velocities[free], "velocities", scale=3.0)
        missed = (after.headings - plain.turned + np.pi) % (2 * np.pi) - np.pi
        assert_close(missed * plain.rolls, np.zeros_like(missed), "headings", 3.0)
        rates = np.where(plain.rolls, plain.rates, 0.0)
        assert_close(after.turn_rates, rates, "turn rates", 60.0)
        seen["turned"] += int((abs(after.headings - before.headings) > 0.1).sum())

        charge, unsure_charge = plain.charged(before, after.positions)
        assert_close(after.charge[~unsure_charge], charge[~unsure_charge], "charges")
        seen["charged"] += int((after.charge > before.charge).sum())
        seen["ran empty"] += int(((after.charge == 0) & (before.charge > 0)).sum())
        met, unsure = plain.met(before, after.positions, charge)
        unsure |= unsure_charge
        expected, lost, served = plain.settle(before, met)
        found = [
            (int(row["env"]), int(row["slot"]), *(h for h in row.tolist()[6:] if h >= 0))
            for row in result.rescues
        ]
        load, unsure_load = plain.reloaded(before, after.positions, found)
        assert_close(after.load[~unsure_load], load[~unsure_load], "loads")
        seen["refilled"] += int((after.load > before.load).sum())
        seen["used up"] += int(((after.load == 0) & (before.load > 0)).sum())
        sure = [row for row in found if not unsure[row[0]]]
        assert sure == [row for row in expected if not unsure[row[0]]]
        for row in result.rescues:
            victim = before.victims[row["env"], row["slot"]]
            assert (row["victim"], row["task"]) == (victim["id"], victim["task"])
            assert row["step"] == steps[row["env"]]
            assert row["episode"] == env.episodes()[row["env"]]
        gone = np.zeros(before.victims.shape, dtype=bool)
        losses = env.lost()
        gone[losses["env"], losses["slot"]] = True
        assert (gone == lost)[~unsure].all()
        assert (losses["victim"] == before.victims["id"][losses["env"], losses["slot"]]).all()
        assert (losses["task"] == before.victims["task"][losses["env"], losses["slot"]]).all()
        assert (losses["step"] == steps[losses["env"]]).all()
        assert (losses["episode"] == env.episodes()[losses["env"]]).all()
        lost = gone.copy()  # as the worlds have it, where rounding decides
        for world, slot, *_ in found:
            gone[world, slot] = True
            rescued[world] += 1
        assert (env.step_counts() == steps + 1).all()
        seen["turned away"] += int(env.turned_away().sum())
        seen["appeared"] += check_victims(plain, env, before, after, gone, given)
        given = np.maximum(given, after.victims["id"].max(1) + 1)
        if plain.service.any():
            stays = before.present & ~gone & ~unsure[:, None]
            needed = np.maximum(plain.service[before.victims["task"]], 1)
            assert_close(after.victims["served"][stays], (served / needed)[stays], "service")
            seen["served"] += int(((served > 0) & stays).sum())
        seen["lost"] += int(lost.sum())
        if scenario.has_order:
            waiting = plain.waiting(before)
            assert (before.victims["blocked"] == waiting).all()
            seen["waiting"] += int(waiting.sum())
            seen["went on"] += int((waiting & ~gone & ~plain.waiting(after)).sum())

        goal = scenario.end_when_rescued
        terminated = rescued >= goal if goal else np.zeros(num_envs, dtype=bool)
        if scenario.end_when_done:
            terminated = terminated | plain.is_done(after)
            seen["done"] += int(plain.is_done(after).sum())
        assert (result.terminated == terminated).all()
        assert (result.truncated == (steps + 1 >= scenario.episode_steps)).all()

        parts = env.reward_components()
        contact = parts[..., env.reward_component_names.index("contact")]
        touched = contact != 0
        assert np.isin(contact, [0.0, np.float32(-scenario.contact_cost)]).all()
        assert not touched[free].any()
        rewards = plain.reward_components(before, after, drive, found, lost, terminated)
        rewards["contact"] = contact
        wanted = np.stack([rewards[name] for name in env.reward_component_names], axis=-1)
        # Sums of float32 distances are as exact as the sums are large.
        sums = [plain.total_distance(one, one.positions) for one in (before, after)]
        size = 1.0 + np.max(sums)
        assert_close(parts, wanted, "reward components", scale=size)
        assert_close(result.reward, wanted.sum(-1), "reward", scale=size + scenario.rescue_reward)

        if scenario.has_limited_sight:
            seen.update(check_sight(plain, before, after))
        if scenario.communication is not None:
            seen.update(check_hearing(plain, after))
        ended = result.terminated | result.truncated
        assert (after.faults[~ended] == before.faults[~ended]).all()
        rays = ray_columns(env.observation_names())
        if rays:
            seen.update(check_rays(plain, after, result.obs[..., rays]))
        found_rows = np.delete(result.obs, rays, axis=-1)
        rows, tied = plain.observations(after)
        times = scenario.has_services + scenario.has_deadlines + scenario.has_order
        times += scenario.has_limited_sight + 2 * scenario.has_wheels
        victims = min(before.victims.shape[1], scenario.observed_victims or 32)
        block = rows.shape[-1] - victims * (3 + len(plain.abilities) + times)
        scale = scenario.arena_half_width_m
        sure = slice(None) if scenario.observed_teammates is None else ~tied
        assert_close(found_rows[sure][..., :block], rows[sure][..., :block], "observation", scale)
        assert_close(found_rows[~tied], rows[~tied], "observation of victims", scale)

        seen["transitions"] += num_envs
        seen["free"] += int(free.sum())
        seen["touched"] += int(touched.any(-1).sum())
        seen["rescues"] += len(found)
        seen["together"] += len(found) - len({row[0] for row in found})
        seen["unsure"] += int(unsure.sum())
        seen["terminated"] += int(terminated.sum())
        seen["unavailable"] += int((~before.available).sum())
        seen["left"] += int((~plain.there(before)).sum())
        over = result.terminated | result.truncated
        if over.any():
            env.reset(mask=over)
            rescued[over] = 0
            given[over] = env.victims()["present"].sum(1)[over]
            assert (env.velocities()[over] == 0).all()
    return seen


@pytest.mark.parametrize("chunk", PARTS)
def test_worlds_are_as_the_plain_stepper_says(chunk: int) -> None:
    total: Counter[str] = Counter()
    rng = np.random.default_rng(100 + chunk)
    while total["transitions"] < LEAST / CHUNKS:
        scenario = random_scenario(rng)
        some = min(LEAST // CHUNKS // 10, 20_000 // len(scenario.robots))
        seed = int(rng.integers(2**32))
        unavailable = "leave" if seed // 3 % 2 else "stay"
        scenario = scenario.replace(observe_faults=seed % 2 == 0, unavailable_robots=unavailable)
        total += compare(scenario, seed, some, faulty=seed % 3 == 0)
    # What was compared must have been worth comparing.
    assert total["free"] > 0.5 * total["transitions"]
    assert total["unsure"] < 0.02 * total["transitions"]
    for what in ("touched", "rescues", "appeared", "together", "unavailable", "left"):
        assert total[what] > 50, (what, total)


@pytest.mark.parametrize("chunk", THIRDS)
def test_worlds_without_contacts_are_as_the_plain_stepper_says(chunk: int) -> None:
    """In small arenas, so that many robots would touch each other and walls."""
    rng = np.random.default_rng(900 + chunk)

    def small(scenario: Scenario) -> Scenario:
        half = 0.75 * scenario.arena_half_width_m
        return scenario.replace(
            engine="none", obstacles=(), arena_half_width_m=half, rescue_radius_m=0.5 * half
        )

    total = compare_some(rng, small)
    assert total["free"] > 0.9 * total["transitions"]
    assert total["touched"] == 0
    for what in ("rescues", "appeared"):
        assert total[what] > 50, (what, total)


def compare_some(
    rng: np.random.Generator,
    changed: Callable[[Scenario], Scenario],
    transitions: int = 8_000,
) -> Counter[str]:
    """Transitions of random scenarios, each ``changed``; counts what was seen."""
    total: Counter[str] = Counter()
    while total["transitions"] < transitions:
        scenario = changed(random_scenario(rng))
        some = min(1000, 20_000 // len(scenario.robots))
        seed = int(rng.integers(2**32))
        total += compare(scenario, seed, some, faulty=seed % 3 == 0)
    assert total["unsure"] < 0.02 * total["transitions"]
    return total


@pytest.mark.parametrize("chunk", THIRDS)
def test_worlds_with_services_and_deadlines_are_as_the_plain_stepper_says(chunk: int) -> None:
    rng = np.random.default_rng(200 + chunk)
    total = compare_some(rng, lambda scenario: with_times(scenario, rng))
    for what in ("rescues", "appeared", "served", "lost"):
        assert total[what] > 50, (what, total)


@pytest.mark.parametrize("chunk", THIRDS)
def test_worlds_with_amounts_are_as_the_plain_stepper_says(chunk: int) -> None:
    rng = np.random.default_rng(300 + chunk)

    def changed(scenario: Scenario) -> Scenario:
        scenario = with_amounts(scenario, rng)
        return with_times(scenario, rng) if rng.random() < 0.3 else scenario

    total = compare_some(rng, changed)
    for what, least in (("rescues", 50), ("appeared", 50), ("served", 0)):
        assert total[what] > least, (what, total)


@pytest.mark.parametrize("chunk", THIRDS)
def test_worlds_with_an_order_of_tasks_are_as_the_plain_stepper_says(chunk: int) -> None:
    rng = np.random.default_rng(400 + chunk)

    def changed(scenario: Scenario) -> Scenario:
        scenario = with_order(scenario, rng)
        return with_times(scenario, rng) if rng.random() < 0.5 else scenario

    total = compare_some(rng, changed)
    for what in ("rescues", "appeared", "waiting", "went on"):
        assert total[what] > 50, (what, total)


@pytest.mark.parametrize("chunk", THIRDS)
def test_worlds_in_which_victims_arrive_are_as_the_plain_stepper_says(chunk: int) -> None:
    rng = np.random.default_rng(500 + chunk)

    def changed(scenario: Scenario) -> Scenario:
        arriving = (with_arrivals, with_list)[rng.integers(2)]
        scenario = arriving(scenario, rng)
        return with_times(with_order(scenario, rng), rng) if rng.random() < 0.5 else scenario

    total = compare_some(rng, changed)
    for what in ("rescues", "appeared", "turned away", "lost"):
        assert total[what] > 50, (what, total)


@pytest.mark.parametrize("chunk", THIRDS)
def test_worlds_whose_tasks_have_areas_are_as_the_plain_stepper_says(chunk: int) -> None:
    rng = np.random.default_rng(1700 + chunk)

    def changed(scenario: Scenario) -> Scenario:
        scenario = with_arrivals(scenario, rng) if rng.random() < 0.3 else scenario
        return with_areas(scenario, rng)

    total = compare_some(rng, changed)
    for what in ("rescues", "appeared"):
        assert total[what] > 50, (what, total)


@pytest.mark.parametrize("chunk", THIRDS)
def test_worlds_with_batteries_are_as_the_plain_stepper_says(chunk: int) -> None:
    rng = np.random.default_rng(600 + chunk)

    def changed(scenario: Scenario) -> Scenario:
        scenario = with_batteries(scenario, rng)
        return with_times(scenario, rng) if rng.random() < 0.3 else scenario

    total = compare_some(rng, changed)
    for what in ("rescues", "appeared", "charged", "ran empty"):
        assert total[what] > 50, (what, total)


@pytest.mark.parametrize("chunk", THIRDS)
def test_worlds_with_loads_are_as_the_plain_stepper_says(chunk: int) -> None:
    rng = np.random.default_rng(700 + chunk)

    def changed(scenario: Scenario) -> Scenario:
        for other in (with_amounts, with_batteries, with_times):
            scenario = other(scenario, rng) if rng.random() < 0.3 else scenario
        return with_loads(scenario, rng).replace(episode_steps=60, end_when_rescued=None)

    total = compare_some(rng, changed)
    for what in ("rescues", "appeared", "refilled", "used up"):
        assert total[what] > 50, (what, total)


@pytest.mark.parametrize("chunk", THIRDS)
def test_worlds_with_layers_and_set_velocities_are_as_the_plain_stepper_says(chunk: int) -> None:
    rng = np.random.default_rng(1000 + chunk)

    def changed(scenario: Scenario) -> Scenario:
        scenario = with_layers(scenario, rng)
        return with_batteries(scenario, rng) if rng.random() < 0.3 else scenario

    total = compare_some(rng, changed)
    for what in ("free", "touched", "rescues", "appeared"):
        assert total[what] > 50, (what, total)


@pytest.mark.long  # teams are large, and many transitions end nothing
@pytest.mark.parametrize("chunk", THIRDS)
def test_worlds_that_end_when_all_is_done_are_as_the_plain_stepper_says(chunk: int) -> None:
    rng = np.random.default_rng(800 + chunk)

    def changed(scenario: Scenario) -> Scenario:
        scenario = with_times(with_list(scenario, rng), rng)
        arrivals = scenario.arrivals[: rng.integers(1, 8)]
        return scenario.replace(arrivals=arrivals, end_when_done=True, episode_steps=60)

    total = compare_some(rng, changed)
    for what, least in (("rescues", 50), ("appeared", 50), ("lost", 50), ("done", 20)):
        assert total[what] > least, (what, total)


@pytest.mark.parametrize("chunk", THIRDS)
def test_worlds_with_wheels_are_as_the_plain_stepper_says(chunk: int) -> None:
    rng = np.random.default_rng(1100 + chunk)

    def changed(scenario: Scenario) -> Scenario:
        scenario = with_wheels(scenario, rng).replace(
            unavailable_robots=("stay", "leave")[rng.integers(2)]
        )
        if rng.random() < 0.3:
            return with_sight(scenario, rng)
        return with_batteries(scenario, rng) if rng.random() < 0.3 else scenario

    total = compare_some(rng, changed)
    for what in ("free", "touched", "rescues", "appeared", "turned"):
        assert total[what] > 50, (what, total)


@pytest.mark.parametrize("chunk", THIRDS)
def test_worlds_with_range_sensors_are_as_the_plain_stepper_says(chunk: int) -> None:
    rng = np.random.default_rng(1200 + chunk)

    def changed(scenario: Scenario) -> Scenario:
        for other in (with_layers, with_wheels):
            scenario = other(scenario, rng) if rng.random() < 0.5 else scenario
        leaves = ("stay", "leave")[rng.integers(2)]
        return with_rays(scenario, rng).replace(unavailable_robots=leaves)

    total = compare_some(rng, changed)
    assert total["met"] > 10_000
    assert total["rays"] - total["met"] > 10_000
    assert total["unsure of rays"] < 0.02 * total["rays"]


@pytest.mark.parametrize("chunk", THIRDS)
def test_worlds_with_a_map_are_as_the_plain_stepper_says(chunk: int) -> None:
    rng = np.random.default_rng(1300 + chunk)

    def changed(scenario: Scenario) -> Scenario:
        while True:
            while len(scenario.robots) > 8:  # every ray meets every box of the plain stepper
                scenario = random_scenario(rng)
            try:
                found = with_layers(scenario, rng) if rng.random() < 0.5 else scenario
                found = with_rays(with_sight(with_map(found, rng), rng), rng)
                return found.replace(occlusion=rng.random() < 0.7)
            except ValueError:  # no room for victims, or an obstacle with a place in a cell
                scenario = random_scenario(rng)

    total = compare_some(rng, changed, 5_000)
    for what in ("free", "touched", "rescues", "appeared", "hidden"):
        assert total[what] > 20, (what, total)
    assert total["met"] > 1000
    assert total["unsure of rays"] < 0.02 * total["rays"]


@pytest.mark.parametrize("situation", ["single", "double", "mixed"])
@pytest.mark.parametrize("shaping", ["progress", "potential", "none"])
@pytest.mark.parametrize("credit", ["helpers", "team"])
def test_the_usual_team_in_every_situation(situation: str, shaping: str, credit: str) -> None:
    """The default team, whose victims now and then need two robots of one ability."""
    tasks = (*Scenario().tasks, Task(name="task_3", needs=("food", "food")))
    scenario = Scenario().replace(
        situation=situation,
        shaping=shaping,
        rescue_credit=credit,
        tasks=tasks,
        rescue_radius_m=0.9,
        end_when_rescued=4,
        action_cost=0.1,
        contact_cost=0.5,
    )
    seen = compare(scenario, seed=7, transitions=1500)
    assert seen["free"] > 600
    for what in ("touched", "rescues", "appeared", "terminated"):
        assert seen[what] > 40, (what, seen)


@pytest.mark.parametrize("chunk", THIRDS)
def test_worlds_with_limited_sight_are_as_the_plain_stepper_says(chunk: int) -> None:
    rng = np.random.default_rng(1000 + chunk)

    def changed(scenario: Scenario) -> Scenario:
        leaves = ("stay", "leave")[rng.integers(2)]
        scenario = with_sight(scenario, rng).replace(unavailable_robots=leaves)
        if rng.random() < 0.3:
            return with_times(with_order(scenario, rng), rng)
        return with_loads(scenario, rng) if rng.random() < 0.3 else scenario

    total = compare_some(rng, changed)
    for what in ("in sight", "out of sight", "remembered", "hidden", "rescues", "appeared"):
        assert total[what] > 50, (what, total)
    assert total["unsure of sight"] < 0.001 * total["in sight"]


@pytest.mark.parametrize("chunk", THIRDS)
def test_worlds_with_communication_are_as_the_plain_stepper_says(chunk: int) -> None:
    rng = np.random.default_rng(1400 + chunk)

    def changed(scenario: Scenario) -> Scenario:
        leaves = ("stay", "leave")[rng.integers(2)]
        scenario = with_sight(scenario, rng).replace(unavailable_robots=leaves)
        return with_communication(scenario, rng)

    total = compare_some(rng, changed)
    for what in ("heard", "unheard", "told", "in sight", "remembered", "rescues"):
        assert total[what] > 50, (what, total)
