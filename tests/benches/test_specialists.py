"""What the benchmarks of specialists count, and when one takes over."""

from pathlib import Path

import pytest
from after_leaving import HALF, TakingOver, late_rescues, losing_teams, staying
from specialists import enough, scores, write_scenario

from innerattn.config import Scenario
from innerattn.evaluate import run_episodes
from innerattn.evaluate.unseen_teams import SEED, unseen_teams
from innerattn.policies import scripted_policy


def test_teams_are_counted_in_which_a_policy_does_enough() -> None:
    assert enough([0.97, 0.96, 1.2, 0.5], [1.0, 1.0, 1.0, 0.4]) == 3


def test_each_team_is_scored_with_its_own_run(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []

    def load(run: str, scenario: Scenario) -> tuple[None, object]:
        asked.append((run, scenario))
        return None, scripted_policy("hungarian", scenario)

    monkeypatch.setattr("specialists.load_trained", load)
    runs = [f"run-{number}" for number in range(len(unseen_teams()))]
    assert scores(runs, 3) == [1.0] * len(runs)
    assert asked == [(run, team.scenario) for run, team in zip(runs, unseen_teams(), strict=True)]


def test_worlds_are_the_same_when_they_are_read_again(tmp_path: Path) -> None:
    for team in unseen_teams()[::6]:
        assert Scenario.from_toml(write_scenario(tmp_path / "run", team.scenario)) == team.scenario


def test_those_that_stay_can_do_all_tasks() -> None:
    teams = list(losing_teams(3))
    assert all(team not in [one.scenario for one in unseen_teams()] for team in teams)
    for team in teams:
        (fault,) = team.faults
        assert (fault.robot, fault.onset_step) == (team.robots[0].name, HALF)
        assert fault.duration_steps is None
        assert staying(team).robots == team.robots[1:]
        assert staying(team).tasks == team.tasks


def test_a_policy_takes_over_at_half_time() -> None:
    (team,) = losing_teams(1)
    first, second = (scripted_policy(name, team) for name in ("random", "hungarian"))
    both = run_episodes(TakingOver(first, second), team, 4, SEED, record=["actions"])
    alone = run_episodes(scripted_policy("random", team), team, 4, SEED, record=["actions"])
    same = (both.steps["actions"] == alone.steps["actions"]).all(axis=(0, 2))
    assert same[:HALF].all()
    assert not same[HALF:].all()


def test_only_rescues_after_half_time_count() -> None:
    """All in an episode but those of one that ends at half time."""
    (team,) = losing_teams(1)
    policy = TakingOver(*(scripted_policy(name, team) for name in ("greedy", "hungarian")))
    short = team.replace(episode_steps=HALF, faults=[])
    early = run_episodes(scripted_policy("greedy", short), short, 20, SEED).rescue_counts()
    whole = run_episodes(policy, team, 20, SEED).rescue_counts()
    late = late_rescues(policy, team, 20)
    assert late.tolist() == (whole - early).tolist()
    assert 0 < late.sum() < whole.sum()
