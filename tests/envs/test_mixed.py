"""Entities of observations, and batches of unlike teams, against batches of their own."""

from collections.abc import Iterator

import numpy as np
import pytest
from numpy.typing import NDArray

from innerattn.config import Scenario
from innerattn.config.family import Family
from innerattn.config.instances import read_worlds
from innerattn.envs import BatchEnv, Entities, EntityLayout, MixedBatchEnv
from innerattn.errors import ConfigError

PRESETS = ("mixed", "single", "mixed-8", "rescue-16")


def of_features() -> list[Scenario]:
    """Worlds with all keys of tasks and stores, of up to eight robots."""
    worlds = {one.feature: one.scenario for one in read_worlds("standard") if one.name[-4] != "_"}
    small = [one.scenario for one in read_worlds("standard") if one.scenario.num_robots <= 8]
    return [*{tuple(sorted(vars(one))): one for one in small}.values(), *worlds.values()][:12]


def named(names: list[str], row: NDArray[np.float32]) -> dict[str, float]:
    return dict(zip(names, row.tolist(), strict=True))


def cells(layout: EntityLayout, seen: Entities, index: int) -> dict[str, float]:
    """What is in the tables of one robot, by the names of a row; zeros left out."""
    found = named(list(layout.own), seen.own[index])
    found = {f"own.{name}": value for name, value in found.items()}
    for who, names, table, mask in (
        ("teammate", layout.teammate, seen.teammates[index], seen.teammate_mask[index]),
        ("victim", layout.victim, seen.victims[index], seen.victim_mask[index]),
    ):
        for number, (row, there) in enumerate(zip(table, mask, strict=True)):
            known = [name not in ("since_seen", "heard") for name in names]
            assert there == bool(row[known].any())
            found |= {f"{who}_{number}.{n}": value for n, value in named(list(names), row).items()}
    return {name: value for name, value in found.items() if value}


def drawn(count: int) -> list[Scenario]:
    family = Family(robots=(1, 7), unavailable=1.0)
    base = Scenario().replace(unavailable_robots="leave")
    return [family.draw(7, number, base) for number in range(count)]


@pytest.fixture
def mixed() -> Iterator[MixedBatchEnv]:
    with MixedBatchEnv.of([*PRESETS, *drawn(6), "mixed-radio"], 3, seed=5) as env:
        yield env


def test_a_row_by_entity_is_the_row() -> None:
    for scenario in ("mixed", "mixed-sight", *drawn(4)):
        env = BatchEnv(scenario, 4, seed=1)
        for _ in range(6):
            obs = env.step(np.ones((4, env.num_robots), np.int64)).obs
        seen = env.entities(obs)
        layout, names = env.entity_layout, env.observation_names()
        flat = Entities(*(one.reshape(-1, *one.shape[2:]) for one in seen))
        for index, row in enumerate(obs.reshape(-1, env.obs_width)):
            wanted = {name: value for name, value in named(names, row).items() if value}
            assert cells(layout, flat, index) == wanted
        assert np.shares_memory(seen.victims, obs)
        for mine, its in zip(env.entities(), env.entities(env.observe()), strict=True):
            np.testing.assert_array_equal(mine, its)


@pytest.mark.parametrize("threads", [1, 3])
def test_worlds_are_those_of_batches_of_their_own(threads: int) -> None:
    scenarios = [*(Scenario.preset(name) for name in PRESETS), *drawn(4)]
    alone = [
        BatchEnv(one, 3, 5, num_threads=1, first_env=3 * number)
        for number, one in enumerate(scenarios)
    ]
    rng = np.random.default_rng(3)
    with MixedBatchEnv.of(scenarios, 3, 5, threads) as env:
        assert env.num_threads == threads
        assert env.num_envs == 3 * len(scenarios)
        assert env.num_robots == sum(3 * one.num_robots for one in alone)
        check(env, env.reset(), [one.reset() for one in alone])
        for _ in range(60):  # past the end of episodes
            actions = rng.integers(5, size=env.num_robots)
            step = env.step(actions)
            own, at = [], 0
            for one in alone:
                size = 3 * one.num_robots
                own.append(one.step(actions[at : at + size].reshape(3, -1)))
                at += size
            check(env, step.entities, [one.obs for one in own])
            for name in ("terminated", "truncated"):
                np.testing.assert_array_equal(
                    getattr(step, name), np.concatenate([getattr(one, name) for one in own])
                )
            np.testing.assert_array_equal(
                step.reward, np.concatenate([one.reward.ravel() for one in own])
            )
            for mine, its in zip(step.steps, own, strict=True):
                np.testing.assert_array_equal(mine.rescues, its.rescues)
        check(env, env.final_entities(step), [one.final_obs for one in own])
        check(env, env.entities(), [one.observe() for one in alone])


def check(env: MixedBatchEnv, seen: Entities, rows: list[NDArray[np.float32]]) -> None:
    index = 0
    for world_batch, part in zip(env.batches, rows, strict=True):
        names = world_batch.observation_names()
        for row in part.reshape(-1, part.shape[-1]):
            wanted = {name: value for name, value in named(names, row).items() if value}
            assert cells(env.layout, seen, index) == wanted
            index += 1
    assert index == env.num_robots


def test_tables_that_are_kept_stay_as_they_are(mixed: MixedBatchEnv) -> None:
    """Memory is used again, but not of tables, parts or other views of tables that are in use."""
    rng = np.random.default_rng(0)
    kept, copies, addresses = [], [], set()
    for number in range(60):
        seen = mixed.step(rng.integers(5, size=mixed.num_robots)).entities
        addresses.add(seen.victims.ctypes.data)
        if number % 10 == 0:
            one = (seen, seen.victims[3:], memoryview(seen.teammates), seen.own.T)[number // 10 % 4]
            kept.append(one)
            copies.append([np.array(x) for x in (one if isinstance(one, Entities) else [one])])
    assert len(addresses) < 20
    for one, copy in zip(kept, copies, strict=True):
        for mine, its in zip(one if isinstance(one, Entities) else [one], copy, strict=True):
            np.testing.assert_array_equal(np.asarray(mine), its)


def test_columns_of_all_batches_are_there_once(mixed: MixedBatchEnv) -> None:
    for one in mixed.batches:
        for who in ("own", "teammate", "victim"):
            names = getattr(one.entity_layout, who)
            assert set(names) <= set(getattr(mixed.layout, who))
    for names in (mixed.layout.own, mixed.layout.teammate, mixed.layout.victim):
        assert len(set(names)) == len(names)
    # The keys of tasks and stores add columns; all worlds together have all of them.
    with MixedBatchEnv.of(of_features(), 1) as env:
        assert {"served", "time_left", "blocked", "present"} <= set(env.layout.victim)
        assert {"charge", "load"} <= set(env.layout.own)
        check(env, env.reset(), [one.observe() for one in env.batches])


def test_who_stands_where(mixed: MixedBatchEnv) -> None:
    begin = 0
    for number, one in enumerate(mixed.batches):
        for world in np.flatnonzero(mixed.batch_of_world == number):
            robots = np.flatnonzero(mixed.world_of_robot == world)
            np.testing.assert_array_equal(robots, np.arange(begin, begin + one.num_robots))
            begin += one.num_robots
    assert begin == mixed.num_robots


def test_a_team_can_be_replaced(mixed: MixedBatchEnv) -> None:
    old, others = mixed.batches[1], mixed.batches[2:]
    mixed.step(np.zeros(mixed.num_robots, np.int64))
    mixed.replace(1, BatchEnv("mixed-16", 2, seed=1, num_threads=1))
    assert mixed.layout.teammates == 15
    assert mixed.num_envs == 3 * (len(others) + 1) + 2
    step = mixed.step(np.zeros(mixed.num_robots, np.int64))
    assert step.entities.own.shape[0] == mixed.num_robots
    assert [int(one.step_counts()[0]) for one in mixed.batches[:3]] == [2, 1, 2]
    with pytest.raises(RuntimeError, match="closed"):
        old.observe()
    before = mixed.batches
    for number, batch, message in (
        (99, BatchEnv("mixed", 1), "number = 99: must be in 0"),
        (0, before[2], "one of them is there twice"),
        (0, BatchEnv(Scenario().replace(actions="continuous"), 1), "all must have discrete"),
    ):
        with pytest.raises(ValueError, match=message):
            mixed.replace(number, batch)
        assert mixed.batches is before
    mixed.step(np.zeros(mixed.num_robots, np.int64))


def test_what_is_wrong_is_named(mixed: MixedBatchEnv) -> None:
    counts = [one.step_counts().tolist() for one in mixed.batches]
    with pytest.raises(ValueError, match=r"actions have shape \(3,\): must have"):
        mixed.step([0, 1, 2])
    assert [one.step_counts().tolist() for one in mixed.batches] == counts
    with pytest.raises(ValueError, match="must hold one or more"):
        MixedBatchEnv([])
    with pytest.raises(TypeError, match=r"batches\[0\] = 'mixed': must be a BatchEnv"):
        MixedBatchEnv(["mixed"])  # type: ignore[list-item]
    with pytest.raises(ValueError, match="num_threads = 0: must be in"):
        MixedBatchEnv(mixed.batches, 0)
    with pytest.raises(ConfigError):
        MixedBatchEnv.of(["mixt"], 2)


def test_an_error_in_one_batch_lets_the_others_step() -> None:
    for threads in (1, 2):
        with MixedBatchEnv.of(["mixed", "single"], 2, num_threads=threads) as env:
            actions = np.zeros(env.num_robots, np.int64)
            actions[0] = 9
            with pytest.raises(ValueError, match="actions"):
                env.step(actions)
            assert env.batches[0].step_counts().tolist() == [0, 0]
            assert env.batches[1].step_counts().tolist() == [1, 1]


def test_continuous_actions() -> None:
    scenarios = [Scenario.preset(one).replace(actions="continuous") for one in PRESETS[:3]]
    with MixedBatchEnv.of(scenarios, 2) as env:
        actions = np.full((env.num_robots, 2), 0.5, np.float32)
        step = env.step(actions)
        one = BatchEnv(scenarios[0], 2)
        np.testing.assert_array_equal(step.steps[0].obs, one.step(actions[:8].reshape(2, 4, 2)).obs)
        with pytest.raises(ValueError, match="actions have shape"):
            env.step(actions[:, 0])
