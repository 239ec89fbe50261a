"""Rescues of a line of metrics, with and without episodes that rescues end."""

import numpy as np
import pytest

from innerattn.config import load_run_config
from innerattn.evaluate.play import run_episodes
from innerattn.evaluate.training_score import training_rescues
from innerattn.policies import scripted_policy
from innerattn.records.logged import logged_rescues, still_rises, unit_of_rescues

LINE = {"rescues_per_episode": 3.0, "rescues_per_env_step": 0.02}


def test_episodes_of_one_length_are_counted_as_they_end() -> None:
    config = load_run_config()
    assert logged_rescues(config, LINE) == 3.0
    assert logged_rescues(config, {**LINE, "rescues_per_episode": None}) is None
    assert unit_of_rescues(config) == "episode"


def test_where_rescues_end_episodes_all_env_steps_count() -> None:
    config = load_run_config(overrides={"scenario.end_when_rescued": 2})
    assert logged_rescues(config, LINE) == pytest.approx(0.02 * 25)
    assert logged_rescues(config, {"rescues_per_episode": 2.0}) == 2.0  # of an older run
    assert unit_of_rescues(config) == "25 steps"
    done = load_run_config(
        overrides={"scenario.situation": "listed", "scenario.end_when_done": True}
    )
    assert logged_rescues(done, LINE) == pytest.approx(0.02 * 25)
    assert unit_of_rescues(done) == "25 steps"


def test_scripts_are_counted_in_the_same_way() -> None:
    config = load_run_config(overrides={"scenario.end_when_rescued": 2})
    scenario = config.training_scenario
    record = run_episodes(
        scripted_policy("hungarian", scenario), scenario, 50, 0, purpose="training"
    )
    assert record.lengths.min() < 25
    wanted = len(record.rescues) / record.lengths.sum() * 25
    assert training_rescues(config, "hungarian", 50, 1) == pytest.approx(wanted)


@pytest.mark.parametrize(
    ("course", "rises"),
    [
        ([], False),
        ([0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0], False),  # too few
        (list(range(8)), True),
        ([0.1 * n for n in range(40)], True),
        ([1.0] * 40, False),
        ([0.0] * 40, False),
        ([3.0 - 0.1 * n for n in range(40)], False),
        ([2.0 * (1.0 - 0.5**n) for n in range(60)], False),  # it has come to its end
        ([min(n, 20) / 20 for n in range(40)], False),
        ([0.02 + 0.01 * (n % 3) for n in range(40)], False),  # noise
    ],
)
def test_courses_that_rise_to_their_end(course: list[float], rises: bool) -> None:
    assert still_rises(course) is rises


def test_noise_hardly_passes_for_a_rise() -> None:
    rng = np.random.default_rng(0)
    share = np.mean([still_rises(list(rng.normal(1.0, 0.2, 40))) for _ in range(2_000)])
    assert share < 0.05
