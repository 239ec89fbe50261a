"""The summary of records made by hand."""

import json
from dataclasses import replace

import numpy as np
import pytest

from innerattn.config import Scenario
from innerattn.measures import measures_of
from innerattn.measures.summary import summarise
from innerattn.records.record import Record, rescue_dtype
from innerattn.stats.estimate import as_json

SCENARIO = Scenario.preset("double")
NAMES = tuple(robot.name for robot in SCENARIO.robots)


def record(
    policy: str, rows: list[tuple[int, int, int, int]], episodes: int, first: int = 0
) -> Record:
    """Events are (episode, task, food robot, partner)."""
    events = np.zeros(len(rows), rescue_dtype(SCENARIO))
    for event, (episode, task, food, partner) in zip(events, rows, strict=True):
        event["episode"], event["task"] = episode, task
        event["helper_0"], event["helper_1"] = food, partner
    return Record(
        policy=policy,
        scenario=SCENARIO,
        robot_names=NAMES,
        seed=3,
        first_episode=first,
        lengths=np.full(episodes, 25),
        rescues=events,
        reward_names=("rescue",),
        rewards_total=np.zeros((episodes, 4, 1)),
    )


HELP_1, HELP_2 = (0, 0, 3), (1, 1, 2)
RECORDED = record("td-inner", [(0, *HELP_1), (1, *HELP_2)], 2)
REST = record("td-inner", [(2, *HELP_1), (2, *HELP_2), (3, *HELP_2), (3, *HELP_2)], 2, first=2)
STANDARD = {
    "td-inner": [RECORDED, REST],
    "random": [record("random", [], 4)],
    "greedy": [record("greedy", [(e, *HELP_1) for e in range(4)], 4)],
    "hungarian": [record("hungarian", [(e % 4, *HELP_1) for e in range(12)], 4)],
}


def test_figures_by_hand() -> None:
    summary = summarise("runs/x", RECORDED, STANDARD, STANDARD)
    assert (summary.policy, summary.method, summary.situation) == ("runs/x", "td-inner", "double")
    assert (summary.episodes, summary.standard.episodes, summary.seed) == (2, 4, 3)
    assert summary.standard.rescues_per_episode.mean == 1.5  # 1, 1, 2, 2
    assert 1.0 <= summary.standard.rescues_per_episode.low <= 1.5
    assert summary.standard.score is not None
    assert summary.standard.score.mean == pytest.approx(1.5 / 3)
    assert {name: value.mean for name, value in summary.standard.scripted.items()} == {
        "random": 0.0,
        "greedy": 1.0,
        "hungarian": 3.0,
    }
    scores = {name: summary.standard.script_score(name) for name in summary.standard.scripted}
    assert scores == {"random": 0.0, "greedy": pytest.approx(1 / 3), "hungarian": 1.0}
    assert replace(summary.standard, score=None).script_score("greedy") is None
    # Cooperation is of the recorded episodes alone.
    assert summary.cooperation == {
        "task_1": {"food_0": 1, "food_1": 0},
        "task_2": {"food_0": 0, "food_1": 1},
    }
    assert summary.cooperation_rates["medical_0"] == {
        "food_0": 1.0,
        "food_1": 0.0,
        "navigation_0": 0.0,
    }
    assert summary.attention_entropy == summary.attention_entropy_share == {}


def test_a_score_of_1_is_as_good_as_planner_where_plans_are_asked_for() -> None:
    task = SCENARIO.tasks[0].replace(deadline_s=3.0)
    timed = SCENARIO.replace(tasks=(task, SCENARIO.tasks[1]))
    planned = [record("planner", [(e % 4, *HELP_1) for e in range(24)], 4)]
    records = {
        name: [replace(part, scenario=timed) for part in parts]
        for name, parts in {**STANDARD, "planner": planned}.items()
    }
    recorded = replace(RECORDED, scenario=timed)
    found = summarise("runs/x", recorded, records, records).standard
    assert list(found.scripted) == ["random", "greedy", "hungarian", "planner"]
    assert found.score is not None
    assert found.score.mean == pytest.approx(1.5 / 6)
    assert found.script_score("hungarian") == pytest.approx(0.5)


def test_attention_is_reported_by_robot_and_head() -> None:
    weights = np.broadcast_to((1 - np.eye(4)) / 3, (2, 25, 4, 4, 4)).astype(np.float32)
    summary = summarise("x", replace(RECORDED, steps={"attention": weights}), STANDARD, STANDARD)
    assert list(summary.attention_entropy) == list(NAMES)
    for name in NAMES:
        assert summary.attention_entropy[name] == pytest.approx([np.log(3)] * 4, abs=1e-6)
        assert summary.attention_entropy_share[name] == pytest.approx([1.0] * 4, abs=1e-6)


def test_document() -> None:
    document = summarise("runs/x", RECORDED, STANDARD, STANDARD).to_json()
    assert json.loads(json.dumps(document, allow_nan=False)) == document
    assert document["schema_version"] == 1
    for name in ("rescues_per_episode", "score"):
        assert set(document[name]) == {"mean", "low", "high"}
    assert document["long"]["scripted"]["hungarian"]["mean"] == 3.0
    for part in (document, document["long"]):
        assert list(part["measures"]) == ["td-inner", "random", "greedy", "hungarian"]
        for name, parts in STANDARD.items():
            assert part["measures"][name] == as_json(measures_of(*parts))
    own = document["measures"]["td-inner"]
    assert own["rescues_per_episode"] == document["rescues_per_episode"]
    assert own["left"] is None  # victims were not recorded
    assert {
        "policy": "runs/x",
        "method": "td-inner",
        "warm_start": "none",
        "situation": "double",
        "episodes": 2,
        "episode_steps": 25,
        "seed": 3,
        "score_episodes": 4,
        "attention_entropy": {},
    }.items() <= document.items()


def test_no_score_is_null() -> None:
    equal = STANDARD | {"hungarian": [record("hungarian", [], 4)]}
    document = summarise("runs/x", RECORDED, equal, equal).to_json()
    assert document["score"] is None
