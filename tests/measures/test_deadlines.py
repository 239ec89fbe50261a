"""Lost victims against a plain loop over recorded episodes."""

import pytest

from innerattn.config import Scenario
from innerattn.evaluate.play import run_episodes
from innerattn.measures import MEASURES, measures_of
from innerattn.measures.deadlines import in_time
from innerattn.measures.waiting import waiting
from innerattn.policies import scripted_policy
from innerattn.records.record import Record

NAMES = ("lost", "in_time")


def record_of(situation: str, **times: object) -> Record:
    plain = Scenario.preset(situation)
    worlds = plain.replace(tasks=tuple(task.replace(**times) for task in plain.tasks))
    policy = scripted_policy("greedy", worlds)
    return run_episodes(policy, worlds, 30, 8, first_episode=3, record=("victims",))


@pytest.mark.parametrize("situation", ["single", "double", "mixed"])
def test_against_a_plain_loop(situation: str) -> None:
    record = record_of(situation, service_s=0.2, deadline_s=(0.8, 2.0))
    victims, gone = record.steps["victims"], []
    rescued = {(int(one["episode"]), int(one["victim"])) for one in record.rescues}
    last_seen = {}
    for e, length in enumerate(record.lengths):
        for t in range(length):
            for victim in victims[e, t][victims[e, t]["present"]]:
                last_seen[3 + e, int(victim["id"])] = (t, int(victim["deadline_step"]))
        for (episode, victim), (t, deadline) in last_seen.items():
            if episode == 3 + e and (episode, victim) not in rescued and deadline == t + 1:
                gone.append((episode, victim))
    found = [(int(one["episode"]), int(one["victim"])) for one in record.lost]
    assert sorted(found) == sorted(gone)
    assert len(gone) > 10
    assert measures_of(record)["lost"] == len(gone)
    share = in_time(record)
    assert share is not None
    assert share.mean == pytest.approx(len(rescued) / (len(rescued) + len(gone)))
    assert waiting(record).left == len(last_seen) - len(rescued) - len(gone)


def test_scenarios_without_deadlines_say_nothing_of_them() -> None:
    values = measures_of(record_of("mixed", service_s=0.2))
    assert not values.keys() & set(NAMES)
    assert set(NAMES) <= MEASURES.keys()


def test_a_deadline_that_nobody_misses_is_kept_by_all() -> None:
    record = record_of("mixed", deadline_s=1e6)
    share = in_time(record)
    assert len(record.lost) == 0
    assert share is not None
    assert (share.mean, share.low, share.high) == (1.0, 1.0, 1.0)
