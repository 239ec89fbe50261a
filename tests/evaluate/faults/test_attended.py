"""Failures of attended robots: what is played, and what is retained, against plain loops."""

import numpy as np
import pytest
from attending_script import AttendingScript

from innerattn.config import Scenario
from innerattn.evaluate.faults.attended import Failures, first_helpers, play_failures
from innerattn.evaluate.faults.severity import fault_of
from innerattn.evaluate.play import run_episodes
from innerattn.policies import scripted_policy

WORLDS = Scenario.preset("double").replace(episode_steps=40, rescue_radius_m=0.3)
ONSET, EPISODES, SEED = 15, 12, 3


@pytest.mark.parametrize("seed", range(4))
def test_what_is_retained_against_plain_loops(seed: int) -> None:
    rng = np.random.default_rng(seed)
    alike = 2 + seed % 2
    found = Failures(
        clean=rng.integers(0, 5, 30),
        faulty=rng.integers(0, 4, (alike, 30)),
        attended=rng.random((30, alike)),
        distance=rng.random((30, alike)),
        helper=rng.integers(-1, alike, 30),
    )
    sums = dict.fromkeys(("most", "least", "near", "helper", "other", "clean", "helped"), 0)
    hits, helped, near = 0, 0, 0
    for episode in range(30):
        weights = found.attended[episode].tolist()
        sums["most"] += found.faulty[weights.index(max(weights)), episode]
        sums["least"] += found.faulty[weights.index(min(weights)), episode]
        ways = found.distance[episode].tolist()
        nearest = ways.index(min(ways))
        sums["near"] += found.faulty[nearest, episode]
        near += weights.index(max(weights)) == nearest
        sums["clean"] += found.clean[episode]
        helper = found.helper[episode]
        if helper >= 0:
            sums["helper"] += found.faulty[helper, episode]
            sums["other"] += found.faulty[0 if helper == alike - 1 else helper + 1, episode]
            sums["helped"] += found.clean[episode]
            helped += 1
            hits += weights.index(max(weights)) == helper
    assert found.retained_most() == pytest.approx(sums["most"] / sums["clean"])
    assert found.retained_least() == pytest.approx(sums["least"] / sums["clean"])
    assert found.retained_nearest() == pytest.approx(sums["near"] / sums["clean"])
    assert found.attends_nearest() == pytest.approx(near / 30)
    assert found.retained_helper() == pytest.approx(sums["helper"] / sums["helped"])
    assert found.retained_other() == pytest.approx(sums["other"] / sums["helped"])
    assert found.attends_helper() == pytest.approx(hits / helped)


def test_without_rescues_nothing_is_retained() -> None:
    none = np.zeros(3, np.int64)
    found = Failures(none, np.zeros((2, 3), np.int64), np.ones((3, 2)), np.ones((3, 2)), none - 1)
    assert found.retained_most() is None
    assert found.retained_other() is None
    assert found.attends_helper() is None


def test_each_food_robot_fails_in_the_same_worlds() -> None:
    policy = AttendingScript(WORLDS)
    done: list[int] = []
    clean, found = play_failures(policy, WORLDS, ONSET, EPISODES, SEED, progress=done.append)
    assert found is not None
    assert done == [EPISODES] * 3
    plain = run_episodes(policy, WORLDS, EPISODES, SEED)
    np.testing.assert_array_equal(plain.rescues, clean.rescues)
    for robot in (0, 1):
        fault = fault_of(WORLDS, robot, "unavailable", 1.0, ONSET)
        faulty = run_episodes(policy, WORLDS.replace(faults=(fault,)), EPISODES, SEED)
        for episode in range(EPISODES):
            rescues = faulty.rescues[faulty.rescues["episode"] == episode]
            assert found.faulty[robot, episode] == (rescues["step"] >= ONSET).sum()
    weights = clean.steps["actor_attention"]
    for episode in range(EPISODES):
        rescues = clean.rescues[clean.rescues["episode"] == episode]
        assert found.clean[episode] == (rescues["step"] >= ONSET).sum()
        for robot in (0, 1):
            of_others = [weights[episode, ONSET, h, i, robot] for h in (0, 1) for i in (2, 3)]
            assert found.attended[episode, robot] == pytest.approx(np.mean(of_others), rel=1e-6)
            places = clean.steps["positions"][episode, ONSET].astype(float)
            ways = [np.hypot(*(places[robot] - places[other])) for other in (2, 3)]
            assert found.distance[episode, robot] == pytest.approx(np.mean(ways))
    assert (found.faulty.sum(1) < found.clean.sum()).all()


def test_first_helpers_against_a_plain_loop() -> None:
    record = run_episodes(scripted_policy("greedy", WORLDS), WORLDS, 40, 1, first_episode=5)
    found = first_helpers(record, [1, 0], 20)
    for episode in range(40):
        helper = -1
        for event in record.rescues:
            of_episode = event["episode"] == episode + 5 and event["step"] >= 20
            if helper < 0 and of_episode:
                food = [event[name] for name in ("helper_0", "helper_1") if event[name] in (0, 1)]
                helper = {1: 0, 0: 1}[food[0]]
        assert found[episode] == helper
    assert {-1, 0, 1} >= set(found.tolist()) >= {0, 1}


def test_without_attention_or_robots_alike_nothing_fails() -> None:
    script = scripted_policy("greedy", WORLDS)
    assert play_failures(script, WORLDS, ONSET, 2, SEED)[1] is None
    alone = WORLDS.replace(robots=WORLDS.robots[1:])
    assert play_failures(AttendingScript(alone), alone, ONSET, 2, SEED)[1] is None
