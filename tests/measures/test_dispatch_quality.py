"""Dispatch quality by hand and against a plain loop over recorded episodes."""

from dataclasses import replace

import numpy as np
import pytest

from innerattn.config import Robot, Scenario, Task
from innerattn.evaluate.play import run_episodes
from innerattn.measures.dispatch_quality import choices_of, dispatch_quality
from innerattn.policies import scripted_policy
from innerattn.policies.scripted.steering import Steering
from innerattn.records.record import Record, rescue_dtype

FIELDS = ("positions", "velocities", "victims")
VICTIM = [("present", "?"), ("task", "<i8"), ("id", "<i8"), ("appeared_step", "<i8")]
VICTIM += [("x", "<f4"), ("y", "<f4")]


@pytest.fixture(scope="module", params=["single", "double", "mixed"])
def record(request: pytest.FixtureRequest) -> Record:
    scenario = Scenario.preset(request.param)
    policy = scripted_policy("hungarian", scenario)
    return run_episodes(policy, scenario, 40, 3, first_episode=5, record=FIELDS)


def by_a_plain_loop(record: Record) -> list[tuple[float, float]]:
    """Arrival times of the helper and of the other food robot, for each rescue."""
    steering, found = Steering(record.scenario), []
    for event in record.rescues:
        e, slot = event["episode"] - record.first_episode, event["slot"]
        victims = record.steps["victims"][e, :, slot]
        first = min(
            t
            for t in range(record.lengths[e])
            if victims[t]["present"] and victims[t]["id"] == event["victim"]
        )
        place = np.array([[[victims[first]["x"], victims[first]["y"]]]])
        times = steering.arrival_times(
            record.steps["positions"][e : e + 1, first],
            record.steps["velocities"][e : e + 1, first],
            place,
        )[0, :, 0]
        helper = event["helper_0"]
        found.append((float(times[helper]), float(times[1 - helper])))
    return found


def test_against_a_plain_loop(record: Record) -> None:
    quality, times = dispatch_quality(record), by_a_plain_loop(record)
    assert quality.choices == len(times) == len(record.rescues) > 40
    assert quality.sooner is not None
    assert quality.sooner.mean == pytest.approx(np.mean([own <= other for own, other in times]))
    assert quality.sooner.low < quality.sooner.mean < quality.sooner.high
    assert quality.regret_s is not None
    regrets = [max(own - other, 0.0) for own, other in times]
    assert quality.regret_s.mean == pytest.approx(np.mean(regrets))
    assert quality.regret_by_chance_s == pytest.approx(
        np.mean([abs(own - other) / 2 for own, other in times])
    )
    assert quality.sooner_by_chance == pytest.approx(0.5)


def test_good_dispatch_is_better_than_chance(record: Record) -> None:
    quality = dispatch_quality(record)
    assert quality.sooner is not None
    assert quality.regret_s is not None
    assert quality.regret_by_chance_s is not None
    assert quality.sooner.low > 0.5
    assert quality.regret_s.high < quality.regret_by_chance_s


def made(
    scenario: Scenario, events: list[tuple[int, ...]], places: np.ndarray, positions: np.ndarray
) -> Record:
    """Episodes of four steps whose robots rest; ``places`` (E, 2) of one victim since step 1."""
    episodes = len(places)
    victims = np.zeros((episodes, 4, 1), VICTIM)
    victims["present"][:, 1:] = True
    victims["appeared_step"] = 1
    victims["x"], victims["y"] = places[:, None, None].transpose(3, 0, 1, 2)
    still = np.broadcast_to(positions, (episodes, 4, *positions.shape)).astype(np.float32)
    rows = np.zeros(len(events), rescue_dtype(scenario))
    for row, (episode, task, *helpers) in zip(rows, events, strict=True):
        row["episode"], row["step"], row["task"] = episode, 3, task
        for k in range(len(rows.dtype) - 5):
            row[f"helper_{k}"] = helpers[k] if k < len(helpers) else -1
    return Record(
        policy="p",
        scenario=scenario,
        robot_names=tuple(robot.name for robot in scenario.robots),
        seed=0,
        first_episode=0,
        lengths=np.full(episodes, 4),
        rescues=rows,
        reward_names=("rescue",),
        rewards_total=np.zeros((episodes, scenario.num_robots, 1)),
        steps={"positions": still, "velocities": np.zeros_like(still), "victims": victims},
    )


def test_by_hand() -> None:
    # food_0 at 0, food_1 at 1 m: victims at 0.2, 0.4 and at 0.5, as far from both.
    positions = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 0.0], [0.0, 0.0]])
    places = np.array([[0.2, 0.0], [0.4, 0.0], [0.5, 0.0]])
    events = [(0, 0, 0, 3), (1, 1, 1, 2), (2, 0, 1, 3)]
    quality = dispatch_quality(made(Scenario(), events, places, positions))
    assert quality.choices == 3
    assert quality.sooner is not None
    assert quality.sooner.mean == pytest.approx(2 / 3)  # equal times are not too late
    assert quality.regret_s is not None
    assert quality.regret_s.mean == pytest.approx(0.2 / 3, abs=1e-6)  # 1 m/s
    assert quality.sooner_by_chance == pytest.approx((0.5 + 0.5 + 1.0) / 3)
    assert quality.regret_by_chance_s == pytest.approx((0.3 + 0.1) / 3, abs=1e-6)


def test_any_team() -> None:
    def robot(name: str, *abilities: str) -> Robot:
        return Robot(name=name, kind="k", abilities=abilities, max_speed_mps=1.0, mass_kg=1.0)

    team = Scenario(
        robots=(
            robot("a", "lift", "see"),
            robot("b", "lift"),
            robot("c", "see"),
            robot("d", "dig"),
        ),
        tasks=(
            Task(name="heavy", needs=("lift", "lift")),
            Task(name="deep", needs=("dig", "see", "lift")),
        ),
    )
    positions = np.array([[0.0, 0.0], [0.5, 0.0], [1.0, 0.0], [0.0, 0.0]])
    events = [(0, 0, 0, 1), (1, 1, 3, 2, 1)]
    record = made(team, events, np.array([[0.1, 0.0], [0.2, 0.0]]), positions)
    choices = choices_of(record)
    # Two lifters are no choice; to see, c went and not a, to lift, b and not a.
    np.testing.assert_array_equal(choices.helper, [2, 1])
    np.testing.assert_array_equal(choices.episode, [1, 1])
    np.testing.assert_array_equal(
        np.isfinite(choices.times), [[True, False, True, False], [True, True, False, False]]
    )
    quality = dispatch_quality(record)
    assert quality.sooner is not None
    assert (quality.choices, quality.sooner.mean, quality.regret_s) == (2, 0.0, None)


def test_nothing_to_choose() -> None:
    places, positions = np.zeros((2, 2)), np.zeros((4, 2))
    none = dispatch_quality(made(Scenario(), [], places, positions))
    assert (none.choices, none.sooner, none.regret_s, none.sooner_by_chance) == (
        0,
        None,
        None,
        None,
    )
    alone = Scenario(robots=Scenario().robots[1:])
    assert dispatch_quality(made(alone, [(0, 0, 0, 2)], places, positions[1:])).choices == 0


def test_what_was_not_recorded_is_named() -> None:
    record = made(Scenario(), [], np.zeros((1, 2)), np.zeros((4, 2)))
    with pytest.raises(ValueError, match="lacks positions, victims"):
        dispatch_quality(replace(record, steps={"velocities": record.steps["velocities"]}))
