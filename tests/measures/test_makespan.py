"""When all victims of a list are done, against a plain loop over the worlds themselves."""

from pathlib import Path

import numpy as np
import pytest

from innerattn.config import Arrival, Scenario
from innerattn.envs import BatchEnv
from innerattn.evaluate.play import run_episodes
from innerattn.measures import measures_of
from innerattn.policies import PolicyInput, WorldState, scripted_policy
from innerattn.records import Record, read_records, write_records
from innerattn.stats import Estimate

EPISODES, SEED = 30, 12_345
ARRIVALS = tuple(
    Arrival(at_s=0.4 * number, task=f"task_{1 + number % 2}", position_m=(0.5, 0.7 - 0.2 * number))
    for number in range(6)
)
PLAIN = Scenario().replace(situation="listed", arrivals=ARRIVALS, max_victims=1, episode_steps=60)
LISTED = PLAIN.replace(end_when_done=True)


def timed(scenario: Scenario) -> Scenario:
    first, second = scenario.tasks
    return scenario.replace(tasks=(first.replace(deadline_s=1.0), second))


def played(scenario: Scenario) -> Record:
    return run_episodes(scripted_policy("greedy", scenario), scenario, EPISODES, SEED)


def times(scenario: Scenario) -> list[float]:
    """When each episode was done [s], by the worlds themselves; of the others nothing."""
    policy = scripted_policy("greedy", scenario)
    env = BatchEnv(scenario, EPISODES, seed=SEED, num_threads=1, autoreset="disabled")
    obs, found, left = env.reset(), {}, np.full(EPISODES, len(ARRIVALS))
    left -= env.turned_away()
    going = np.ones(EPISODES, bool)
    for index in range(scenario.episode_steps):
        step = env.step(policy.act(PolicyInput(obs, WorldState.of(env))))
        obs = step.obs
        left -= env.turned_away()
        np.subtract.at(left, step.rescues["env"], 1)
        np.subtract.at(left, env.lost()["env"], 1)
        for world in np.flatnonzero(going & (left == 0)):
            found[world] = (index + 1) * scenario.dt_s
        over = step.terminated | step.truncated
        going &= ~over
        env.reset(mask=over)
    return list(found.values())


@pytest.mark.parametrize("steps", [60, 25])
@pytest.mark.parametrize("has_deadlines", [False, True])
def test_against_a_plain_loop(has_deadlines: bool, steps: int) -> None:
    scenario = LISTED.replace(episode_steps=steps)
    scenario = timed(scenario) if has_deadlines else scenario
    found, wanted = measures_of(played(scenario)), times(scenario)
    makespan, done = found["makespan_s"], found["done"]
    assert isinstance(makespan, Estimate)
    assert isinstance(done, Estimate)
    assert makespan.mean == pytest.approx(np.mean(wanted))
    assert done.mean == pytest.approx(len(wanted) / EPISODES)
    assert steps == 60 or 0.1 < done.mean < 1.0


def test_ending_changes_nothing_before_the_end() -> None:
    ends, goes_on = played(LISTED), played(PLAIN)
    assert ends.lengths.max() < 60
    np.testing.assert_array_equal(ends.rescues, goes_on.rescues)
    np.testing.assert_array_equal(ends.turned_away, goes_on.turned_away)
    assert not {"makespan_s", "done"} & measures_of(goes_on).keys()


def test_where_nothing_is_done_there_is_no_time() -> None:
    found = measures_of(played(LISTED.replace(episode_steps=5)))
    assert found["makespan_s"] is None
    done = found["done"]
    assert isinstance(done, Estimate)
    assert done.mean == 0.0


def test_enough_rescues_before_are_no_end_of_all() -> None:
    found = measures_of(played(LISTED.replace(end_when_rescued=2)))
    assert isinstance(found["done"], Estimate)
    assert found["done"].mean == 0.0


def test_stored_and_read_again(tmp_path: Path) -> None:
    record = played(timed(LISTED))
    write_records([record], tmp_path)
    (again,) = read_records(tmp_path)
    assert measures_of(again) == measures_of(record)
