"""Loads used up and refilled, against the loads of the worlds themselves."""

from pathlib import Path

import numpy as np
import pytest

from innerattn.config import Depot, Scenario
from innerattn.envs import BatchEnv
from innerattn.evaluate.play import run_episodes
from innerattn.measures import measures_of, needed_fields
from innerattn.policies import PolicyInput, WorldState, scripted_policy
from innerattn.records import Record, read_records, write_records
from innerattn.stats import Estimate

PLAIN = Scenario.preset("mixed")
EPISODES, SEED = 12, 12_345
SOME = PLAIN.replace(
    robots=(*(one.replace(load=2) for one in PLAIN.robots[:3]), PLAIN.robots[3]),
    depots=(Depot(position_m=(0.0, 0.0), radius_m=0.2),),
    episode_steps=60,
)
"""Three robots with a load, and a depot where many of them pass."""


def played(scenario: Scenario) -> Record:
    policy = scripted_policy("hungarian", scenario)
    return run_episodes(policy, scenario, EPISODES, SEED, record=needed_fields(scenario))


def value(record: Record, name: str) -> Estimate:
    found = measures_of(record)[name]
    assert isinstance(found, Estimate)
    return found


def test_against_a_plain_loop() -> None:
    scenario = SOME.replace(end_when_rescued=7)
    record = played(scenario)
    assert len({*record.lengths}) > 1
    policy = scripted_policy("hungarian", scenario)
    env = BatchEnv(scenario, EPISODES, seed=SEED, num_threads=1, autoreset="disabled")
    obs, going = env.reset(), np.ones(EPISODES, bool)
    used_up = steps = refills = 0
    for _ in range(scenario.episode_steps):
        before = env.load()[:, :3]
        steps += 3 * int(going.sum())
        used_up += int((before[going] == 0.0).sum())
        step = env.step(policy.act(PolicyInput(obs, WorldState.of(env))))
        obs, after = step.obs, env.load()[:, :3]
        over = step.terminated | step.truncated
        for rescue in step.rescues:
            for robot in {rescue["helper_0"], rescue["helper_1"]} & {0, 1, 2}:
                before[rescue["env"], robot] -= 0.5
        refills += int((after > before)[going & ~over].sum())
        going &= ~over
        if not going.any():
            break
        env.reset(mask=over)
    assert value(record, "unloaded").mean == pytest.approx(used_up / steps)
    assert value(record, "refills").mean == pytest.approx(refills / EPISODES)
    assert used_up > 0
    assert refills > EPISODES


def test_without_depots_there_are_no_refills_to_count() -> None:
    found = measures_of(played(SOME.replace(depots=())))
    assert "refills" not in found
    assert isinstance(found["unloaded"], Estimate)
    assert found["unloaded"].mean > 0.3


def test_loads_are_stored_and_read_again(tmp_path: Path) -> None:
    record = played(SOME)
    write_records([record], tmp_path)
    (again,) = read_records(tmp_path)
    np.testing.assert_array_equal(again.steps["load"], record.steps["load"])
    assert measures_of(again) == measures_of(record)


def test_worlds_without_loads_have_neither() -> None:
    assert "load" not in needed_fields(PLAIN)
    record = run_episodes(scripted_policy("greedy", PLAIN), PLAIN, 2, 3, record=("load",))
    assert "load" not in record.steps
    assert not {"unloaded", "refills"} & measures_of(record).keys()
