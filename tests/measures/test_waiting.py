"""Waiting times against a plain loop over recorded episodes."""

from dataclasses import replace

import numpy as np
import pytest

from innerattn.config import Scenario
from innerattn.evaluate.play import run_episodes
from innerattn.measures.waiting import waiting
from innerattn.policies import scripted_policy
from innerattn.records.record import Record


def record_of(policy: str, scenario: Scenario, episodes: int = 30) -> Record:
    return run_episodes(
        scripted_policy(policy, scenario),
        scenario,
        episodes,
        8,
        first_episode=3,
        record=("victims",),
    )


@pytest.mark.parametrize("situation", ["single", "double", "mixed"])
@pytest.mark.parametrize("end_when_rescued", [None, 2])
def test_against_a_plain_loop(situation: str, end_when_rescued: int | None) -> None:
    scenario = Scenario.preset(situation).replace(end_when_rescued=end_when_rescued)
    record = record_of("hungarian", scenario)
    steps_of: dict[tuple[int, int], int] = {}  # steps by episode and victim
    for e, length in enumerate(record.lengths):
        for t in range(length):
            for victim in record.steps["victims"][e, t]:
                if victim["present"]:
                    key = (3 + e, int(victim["id"]))
                    steps_of[key] = steps_of.get(key, 0) + 1
    rescued = [(int(event["episode"]), int(event["victim"])) for event in record.rescues]
    found = waiting(record)
    assert (found.rescued, found.left) == (len(rescued), len(steps_of) - len(rescued))
    assert found.rescued > 30
    assert found.left > 0
    assert found.time_to_rescue_s is not None
    assert found.time_to_rescue_s.mean == pytest.approx(
        np.mean([steps_of[key] for key in rescued]) * scenario.dt_s
    )
    assert found.time_per_rescue_s is not None
    assert found.time_per_rescue_s.mean == pytest.approx(
        sum(steps_of.values()) / len(rescued) * scenario.dt_s
    )
    assert found.time_to_rescue_s.low < found.time_to_rescue_s.mean < found.time_to_rescue_s.high


def test_long_episodes_have_the_same_time_either_way() -> None:
    scenario = Scenario.preset("single").replace(episode_steps=400)
    found = waiting(record_of("hungarian", scenario, 10))
    assert found.time_to_rescue_s is not None
    assert found.time_per_rescue_s is not None
    assert found.time_per_rescue_s.mean == pytest.approx(found.time_to_rescue_s.mean, rel=0.03)


def test_no_rescue() -> None:
    record = record_of("random", Scenario.preset("double").replace(episode_steps=1), 4)
    found = waiting(record)
    assert (found.rescued, found.left) == (0, 8)
    assert found.time_to_rescue_s is found.time_per_rescue_s is None
    with pytest.raises(ValueError, match="lacks victims"):
        waiting(replace(record, steps={}))
