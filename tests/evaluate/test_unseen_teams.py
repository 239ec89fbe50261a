"""The 24 teams that no policy has met: what they are, and scores in them."""

from itertools import islice

import pytest

from innerattn.config.family import Family
from innerattn.evaluate import run_episodes
from innerattn.evaluate.unseen_teams import (
    EPISODE_STEPS,
    GROUPS,
    TeamScore,
    scores_in_unseen_teams,
    unseen_teams,
)
from innerattn.policies import scripted_policy


def test_groups_are_what_they_say() -> None:
    teams, base = unseen_teams(), Family()
    sizes = {group: [t.scenario for t in teams if t.group == group] for group in GROUPS}
    assert [len(sizes[group]) for group in GROUPS] == [8, 8, 4, 4]
    assert [len(one.robots) for one in sizes["sizes"]] == [2, 3, 5, 7, 10, 14, 18, 24]
    for scenario in sizes["bodies"]:
        speeds = [robot.max_speed_mps for robot in scenario.robots]
        masses = [robot.mass_kg for robot in scenario.robots]
        (least_speed, most_speed), (least, most) = base.max_speed_mps, base.mass_kg
        slow_or_fast = min(speeds) >= most_speed or max(speeds) <= least_speed
        assert slow_or_fast or min(masses) >= most or max(masses) <= least
    assert all(len(one.faults) == 1 for one in sizes["changes"])
    assert {fault.kind for one in sizes["changes"] for fault in one.faults} == {
        "unavailable",
        "speed_limit",
    }
    assert {one.scenario.episode_steps for one in teams} == {EPISODE_STEPS}


def test_another_seed_draws_other_teams_of_the_same_groups() -> None:
    usual, others = unseen_teams(), unseen_teams(1)
    assert [one[:2] for one in others] == [one[:2] for one in usual]
    assert all(one.scenario != other.scenario for one, other in zip(usual, others, strict=True))
    greedy = [
        next(scores_in_unseen_teams(lambda one: scripted_policy("greedy", one), 4, seed=seed)).most
        for seed in (1, 20_261)
    ]
    assert greedy[0] != greedy[1]


def scores(name: str, teams: int = 4, episodes: int = 4) -> list[TeamScore]:
    """Of a script in the first teams."""
    found = scores_in_unseen_teams(
        lambda scenario: scripted_policy(name, scenario, 20_261), episodes, num_threads=1
    )
    return list(islice(found, teams))


def test_a_script_has_the_score_that_its_name_says() -> None:
    assert [one.score for one in scores("hungarian")] == pytest.approx([1.0] * 4)
    assert [one.score for one in scores("random")] == pytest.approx([0.0] * 4)
    assert [one.score for one in scores("greedy")] == [one.greedy for one in scores("random")]


def test_rescues_are_those_of_the_same_episodes_one_by_one() -> None:
    team = unseen_teams()[0]
    (found,) = scores("greedy", 1)
    each = [
        run_episodes(
            scripted_policy("hungarian", team.scenario, 20_261),
            team.scenario,
            1,
            20_261,
            first_episode=number,
        ).rescue_counts()[0]
        for number in range(4)
    ]
    assert found.most == pytest.approx(sum(each) / 4)
    greedy = run_episodes(
        scripted_policy("greedy", team.scenario, 20_261), team.scenario, 4, 20_261
    ).rescue_counts()
    assert found.more.tolist() == [one - other for one, other in zip(greedy, each, strict=True)]


def test_progress_counts_teams() -> None:
    told: list[int] = []
    found = scores_in_unseen_teams(
        lambda scenario: scripted_policy("random", scenario, 1),
        2,
        num_threads=1,
        progress=told.append,
    )
    list(islice(found, 3))
    assert told == [1, 2, 3]
