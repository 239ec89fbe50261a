"""Worlds of a list of victims: what is measured in them, and the set of the package."""

import importlib.util
import json
from collections import Counter
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from innerattn.config.instances import WorldInstance, read_instances, read_worlds
from innerattn.errors import ConfigError
from innerattn.evaluate.instance_worlds import evaluate_worlds, play_world
from innerattn.policies import scripted_policy

ROOT = Path(__file__).parents[2]
CARRIER = {"kind": "carrier", "abilities": ["lift"], "max_speed_mps": 1.0, "mass_kg": 1.0}
LATE = [{"at_s": 0.5, "task": "load", "position_m": [0.5, 0.0]}]


def test_the_name_is_told_whatever_it_is(tmp_path: Path) -> None:
    entry = world("s", {}, (1, 1.0))
    entry["scenario"]["episode_steps"] = 0
    with pytest.raises(ConfigError, match=r"mine.json: s\.scenario.episode_steps = 0"):
        read(tmp_path, entry)


@cache
def standard() -> tuple[WorldInstance, ...]:
    return read_worlds("standard")


def world(name: str, task: dict[str, Any], reference: tuple[int, float]) -> dict[str, Any]:
    """One robot, one victim half a metre away that comes after half a second."""
    rescued, makespan = reference
    return {
        "name": name,
        "feature": "late" if "deadline_s" in task else "early",
        "scenario": {
            "situation": "listed",
            "end_when_done": True,
            "episode_steps": 40,
            "robots": [{"name": "carrier", "start_m": [0.0, 0.0], **CARRIER}],
            "tasks": [{"name": "load", "needs": ["lift"], **task}],
            "arrivals": LATE,
        },
        "reference": {"policy": "greedy", "rescued": rescued, "makespan_s": makespan},
    }


def read(folder: Path, *entries: object) -> tuple[WorldInstance, ...]:
    path = folder / "mine.json"
    path.write_text(json.dumps(entries))
    return read_worlds(path)


def test_scores_compare_makespans_or_rescues(tmp_path: Path) -> None:
    worlds = read(
        tmp_path,
        world("soon", {}, (1, 2.0)),
        world("never", {"service_s": 9.0}, (1, 2.0)),
        world("lost", {"service_s": 0.5, "deadline_s": 0.6}, (1, 1.0)),
    )
    found = evaluate_worlds("hungarian", worlds, 3)
    soon, never, lost = found.played
    # 0.5 s until it comes, then five steps for 0.35 m.
    assert soon.makespan_s == pytest.approx(1.0)
    assert (soon.rescued, never.rescued, lost.rescued) == (1, 0, 0)
    assert never.makespan_s == 4.0  # the end of the episode
    assert lost.makespan_s == pytest.approx(1.1)
    assert [one.score for one in found.worlds] == [2.0, 0.5, 0.0]
    document = found.to_json()
    assert [one["name"] for one in document["instances"]] == ["soon", "never", "lost"]
    assert document["mean_makespan"] == pytest.approx((1.0 + 4.0 + 1.1) / 3)
    assert document["score"] == pytest.approx(2.5 / 3)
    assert document["rescued_share"] == pytest.approx(1 / 3)
    assert document["features"]["late"]["score"] == 0.0
    assert document["features"]["early"]["played"] == 2


def test_worlds_that_a_team_cannot_play_do_not_count(tmp_path: Path) -> None:
    battery = world("battery", {}, (1, 0.9))
    battery["scenario"]["robots"][0]["battery"] = {"capacity_j": 50.0, "per_m_j": 10.0}
    plain = world("plain", {}, (1, 0.9))
    found = evaluate_worlds("zoo:any", read(tmp_path, battery, plain))
    assert [one.played is None for one in found.worlds] == [True, False]
    assert "battery" in found.worlds[0].refusal
    assert found.score == found.worlds[1].score == pytest.approx(1.0, abs=0.3)
    assert found.of("early").means()["played"] == 1
    with pytest.raises(ConfigError, match="battery"):
        evaluate_worlds("zoo:any", read(tmp_path, battery))


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"end_when_done": False}, r"mine.json: w.scenario.end_when_done = false: must be true"),
        ({"arrivals": []}, r"w.scenario.arrivals = \[\]: must have an entry"),
        ({"episode_steps": 0}, r"mine.json: w.scenario.episode_steps = 0: must be in 1..=1000000"),
        ({"engines": 1}, r"w.scenario.engines"),
    ],
)
def test_wrong_worlds_are_refused(change: dict[str, Any], told: str, tmp_path: Path) -> None:
    entry = world("w", {}, (1, 1.0))
    entry["scenario"] |= change
    with pytest.raises(ConfigError, match=told):
        read(tmp_path, entry)


def test_the_two_sorts_are_told_apart(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="standard: has worlds, and no instances of task"):
        read_instances("standard")
    with pytest.raises(ConfigError, match="ral: has instances of task allocation, and no worlds"):
        read_worlds("ral")
    with pytest.raises(ConfigError, match=r"mine.json: other"):
        read(tmp_path, world("one", {}, (1, 1.0)), {"name": "other", "speed": 1.0})


@pytest.fixture(scope="module")
def publish() -> ModuleType:
    """The script that made the set."""
    spec = importlib.util.spec_from_file_location(
        "publish_instances", ROOT / "docs" / "publish_instances.py"
    )
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_set_has_each_feature_at_each_size() -> None:
    worlds = standard()
    found = Counter((one.feature, one.scenario.num_robots) for one in worlds)
    assert len(worlds) == 300
    assert set(found.values()) == {5}
    assert {robots for _, robots in found} == {2, 4, 8, 16, 32, 64}
    keys = {
        "service": lambda one: any(task.service_s > 0 for task in one.tasks),
        "deadlines": lambda one: any(task.deadline_s is not None for task in one.tasks),
        "order": lambda one: any(task.after for task in one.tasks),
        "arrivals": lambda one: any(arrival.at_s > 0 for arrival in one.arrivals),
        "sums": lambda one: all(isinstance(task.needs, dict) for task in one.tasks),
        "batteries": lambda one: any(robot.battery for robot in one.robots),
        "loads": lambda one: any(robot.load for robot in one.robots),
    }
    for one in worlds:
        here = {name for name, has in keys.items() if has(one.scenario)}
        alone = {one.feature} & keys.keys()
        assert here == (set(keys) if one.feature == "together" else alone), one.name


@pytest.mark.parametrize("name", ["plain_2_0", "sums_8_3", "loads_16_2", "together_64_4"])
def test_a_world_of_the_set_is_the_one_that_is_drawn(name: str, publish: ModuleType) -> None:
    (kept,) = (one for one in standard() if one.name == name)
    feature, robots, number = name.split("_")
    for attempt in range(20):
        try:
            drawn = publish.drawn(feature, int(robots), int(number), attempt)
        except ConfigError:
            continue
        if drawn == kept.scenario:
            return
    pytest.fail(f"{name}: is not drawn")


@pytest.mark.parametrize("robots", [2, 8, pytest.param(16, marks=pytest.mark.long)])
def test_references_are_what_their_scripts_reach(robots: int) -> None:
    chosen = [one for one in standard() if one.name.endswith(f"_{robots}_1")]
    assert len(chosen) == 10
    for one in chosen:
        policy = scripted_policy(one.reference.policy, one.scenario)
        played = play_world(policy, one.scenario)
        assert played.rescued == one.reference.rescued, one.name
        assert played.makespan_s == pytest.approx(one.reference.makespan_s), one.name
