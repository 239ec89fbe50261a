"""What a replay page holds: the records, rounded and packed."""

import base64
import gzip
import json
import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from watched import watched

from innerattn.config import Scenario
from innerattn.errors import RunError
from innerattn.evaluate.play import run_episodes
from innerattn.policies import scripted_policy
from innerattn.records.record import FIELDS
from innerattn.report.replay import replay_page
from innerattn.report.replay.data import replay_document

HOSTILE = "</script><script>window.struck=1</script><!--"


def unpacked(document: dict[str, Any], spec: dict[str, Any]) -> Any:
    data = gzip.decompress(base64.b64decode(document["data"]))
    size = int(np.prod(spec["shape"]))
    values = np.frombuffer(data, np.dtype(spec["type"]), size, spec["at"])
    return values.reshape(spec["shape"])


def test_steps_are_kept_to_a_fraction_of_what_can_be_seen() -> None:
    record = watched(episodes=3, actor_heads=2)
    document = json.loads(json.dumps(replay_document([record], ["one"])))
    run, unit = document["runs"][0], document["worlds"]["position_unit_m"]
    positions = unpacked(document, run["positions"]) * unit
    assert np.abs(positions - record.steps["positions"]).max() < 1e-4
    velocities = unpacked(document, run["velocities"]) * run["velocity_unit_mps"]
    assert np.abs(velocities - record.steps["velocities"]).max() < 0.01
    for whose in ("attention", "actor_attention"):
        attention = unpacked(document, run[whose]) / 255
        assert np.abs(attention - record.steps[whose]).max() <= 0.5 / 255 + 1e-6
    names = [one["name"] for one in run["rewards"]]
    assert names == ["rescue", "progress"]
    for one in run["rewards"]:
        kept = unpacked(document, one["values"]) * one["unit"]
        true = record.steps["rewards"][..., record.reward_names.index(one["name"])]
        assert np.abs(kept - true).max() < 1e-4


def test_victims_and_rescues_are_those_of_the_record() -> None:
    record = watched(episodes=5)
    document = replay_document([record], ["one"])
    run, unit = document["runs"][0], document["worlds"]["position_unit_m"]
    victims = unpacked(document, run["victims"])
    seen = {
        (e, int(v["id"])): (v["x"], v["y"])
        for e, t, s in np.argwhere(record.steps["victims"]["present"])
        for v in [record.steps["victims"][e, t, s]]
    }
    assert {(e, i) for e, i, *_ in victims.tolist()} == set(seen)
    for e, i, _, start, end, x, y, slot, deadline in victims.tolist():
        assert deadline == -1
        assert record.steps["victims"][e, start, slot]["id"] == i
        assert np.allclose((x * unit, y * unit), seen[e, i], atol=1e-4)
        there = record.steps["victims"][e]
        steps = np.flatnonzero((there["present"] & (there["id"] == i)).any(-1))
        assert (start, end) == (steps[0], steps[-1] + 1)
    rescues = unpacked(document, run["rescues"])
    names = ("episode", "step", "victim", "task", "helper_0", "helper_1")
    assert rescues.tolist() == [[int(row[n]) for n in names] for row in record.rescues]


def test_services_and_losses_are_those_of_the_record() -> None:
    plain = Scenario.preset("double")
    tasks = tuple(task.replace(service_s=0.4, deadline_s=(1.0, 2.5)) for task in plain.tasks)
    worlds = plain.replace(tasks=tasks)
    record = run_episodes(scripted_policy("hungarian", worlds), worlds, 4, 5, record=FIELDS)
    document = replay_document([record], ["one"])
    (run,) = document["runs"]
    served = unpacked(document, run["served"]) / 255
    assert np.abs(served - record.steps["victims"]["served"]).max() <= 0.5 / 255 + 1e-6
    assert served.any()
    names = ("episode", "step", "victim", "task")
    assert unpacked(document, run["lost"]).tolist() == [
        [int(row[name]) for name in names] for row in record.lost
    ]
    assert len(record.lost)
    for e, _, _, start, end, _, _, slot, deadline in unpacked(document, run["victims"]).tolist():
        assert record.steps["victims"][e, start, slot]["deadline_step"] == deadline >= end


def test_victims_that_arrive_are_there_from_then_on() -> None:
    plain = Scenario.preset("mixed")
    tasks = tuple(task.replace(arrival_rate_hz=0.5) for task in plain.tasks)
    worlds = plain.replace(situation="poisson", tasks=tasks)
    record = run_episodes(scripted_policy("hungarian", worlds), worlds, 6, 5, record=FIELDS)
    (run,) = (document := replay_document([record], ["one"]))["runs"]
    present = np.zeros(record.steps["victims"].shape, bool)
    for e, _, _, start, end, _, _, slot, _ in unpacked(document, run["victims"]).tolist():
        assert start > 0
        present[e, start:end, slot] = True
    np.testing.assert_array_equal(present, record.steps["victims"]["present"])
    assert len({*present.sum((1, 2)).tolist()}) > 1


def test_who_waits_is_that_of_the_record() -> None:
    plain = Scenario.preset("mixed")
    worlds = plain.replace(tasks=(plain.tasks[0].replace(after=("task_2",)), plain.tasks[1]))
    record = run_episodes(scripted_policy("hungarian", worlds), worlds, 4, 5, record=FIELDS)
    (run,) = (document := replay_document([record], ["one"]))["runs"]
    waits = unpacked(document, run["waits"])
    assert (waits == record.steps["victims"]["blocked"]).all()
    assert waits.any()
    assert document["worlds"]["has_order"]


def test_eighty_episodes_of_four_robots_stay_below_a_megabyte() -> None:
    page = replay_page([watched(episodes=80)], ["one"])
    assert len(page.encode()) < 1_000_000


def test_names_end_no_script_and_nothing_is_loaded() -> None:
    page = replay_page([watched(episodes=1)] * 2, [HOSTILE, "@@data@@"])
    assert page.count("</script>") == 2
    assert "<script>window.struck" not in page
    assert len(page) < 200_000
    assert not re.findall(r'(?:src|href)\s*=(?!"#")|@import|url\(', page)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"seed": 6}, r"b: was recorded in other worlds than a \(seed 6, not 5\)"),
        ({"first_episode": 1}, r"first episode 1, not 0"),
        ({"steps": {}}, r"b: actions, positions, velocities, victims, faults were not recorded"),
        (
            {"scenario": Scenario.preset("mixed").replace(dt_s=0.05)},
            r"another scenario: dt_s",
        ),
    ],
)
def test_what_does_not_fit_together_is_refused(change: dict[str, Any], message: str) -> None:
    record = watched(episodes=1)
    with pytest.raises(RunError, match=message):
        replay_document([record, replace(record, **change)], ["a", "b"])


def test_at_most_four_policies() -> None:
    record = watched(episodes=1)
    for count in (0, 5):
        with pytest.raises(RunError, match=f"{count} policies to replay: must be 1 to 4"):
            replay_document([record] * count, ["a"] * count)
