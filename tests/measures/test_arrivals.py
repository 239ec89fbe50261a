"""Victims that were turned away, in records and measures, against a plain loop over worlds."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from innerattn.config import Arrival, Scenario
from innerattn.config.streams import stream_seed
from innerattn.envs import BatchEnv
from innerattn.errors import RunError
from innerattn.evaluate.play import run_episodes
from innerattn.measures import MEASURES, measures_of
from innerattn.policies import PolicyInput, WorldState, scripted_policy
from innerattn.records import read_records, write_records

PLAIN = Scenario.preset("mixed")
WORLDS = PLAIN.replace(
    situation="poisson",
    tasks=tuple(task.replace(arrival_rate_hz=1.5) for task in PLAIN.tasks),
    end_when_rescued=2,
)

LISTED = PLAIN.replace(
    situation="listed",
    arrivals=(
        Arrival(at_s=0.0, task="task_2", position_m=(0.5, 0.5)),
        Arrival(at_s=0.6, task="task_1", position_m=(-0.5, 0.25)),
        Arrival(at_s=0.25, task="task_1", position_m=(0.0, -0.5)),
    ),
)


def test_counts_are_those_of_the_worlds() -> None:
    policy = scripted_policy("greedy", WORLDS)
    parts = [run_episodes(policy, WORLDS, 20, 8, first_episode=start) for start in (0, 20)]
    env = BatchEnv(WORLDS, 40, seed=stream_seed(8, "evaluation"), num_threads=1)
    obs, running, counts = env.reset(), np.ones(40, bool), [0] * 40
    for _ in range(WORLDS.episode_steps):
        step = env.step(policy.act(PolicyInput(obs, WorldState.of(env))))
        for world in np.flatnonzero(running):
            counts[world] += int(env.turned_away()[world])
        obs = step.obs
        running &= ~(step.terminated | step.truncated)
    assert [*parts[0].turned_away, *parts[1].turned_away] == counts
    assert measures_of(*parts)["turned_away"] == sum(counts) > 10
    assert len({*parts[0].lengths}) > 1


@pytest.mark.parametrize("situation", ["poisson", "listed"])
def test_waiting_is_from_arrival_to_rescue(situation: str) -> None:
    worlds = WORLDS if situation == "poisson" else LISTED
    record = run_episodes(scripted_policy("greedy", worlds), worlds, 60, 8, record=("victims",))
    waited, victims = [], record.steps["victims"]
    for rescue in record.rescues:
        row = victims[rescue["episode"], :, rescue["slot"]]
        there = row["present"] & (row["id"] == rescue["victim"])
        arrived = int(np.flatnonzero(there)[0])  # seen at the start of the step after
        waited.append((int(rescue["step"]) + 1 - arrived) * 0.1)
        if situation == "listed":
            assert arrived in (0, 3, 6)
    assert len(waited) > 40
    found = measures_of(record)["time_to_rescue_s"]
    assert found.mean == pytest.approx(np.mean(waited))


def test_other_worlds_turn_nobody_away() -> None:
    record = run_episodes(scripted_policy("greedy", PLAIN), PLAIN, 3, 8)
    assert record.turned_away is None
    assert MEASURES["turned_away"].of(record) is None
    assert "turned_away" not in measures_of(record)


def test_files_keep_them_beside_records_without_any(tmp_path: Path) -> None:
    policy = scripted_policy("random", WORLDS)
    one = run_episodes(policy, WORLDS, 6, 2, record=("victims",))
    other = run_episodes(scripted_policy("random", PLAIN), PLAIN, 6, 2)
    write_records([one, other], tmp_path)
    for steps in (True, False):
        back = read_records(tmp_path, steps=steps)
        np.testing.assert_array_equal(back[0].turned_away, one.turned_away, strict=True)
        assert back[1].turned_away is None
    assert one.turned_away.any()
    write_records([other], tmp_path)
    assert "turned_away" not in pq.read_schema(tmp_path / "episodes.parquet").names
    write_records([replace(one, turned_away=one.turned_away - 99)], tmp_path)
    with pytest.raises(RunError, match="turned away: must be in 0"):
        read_records(tmp_path)
