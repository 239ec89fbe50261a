"""Which teams the benchmark of larger teams plays, and what it calls a score."""

import pytest
from larger_teams import LARGE, TEAMS, large_teams, scores

from innerattn.policies import scripted_policy


def test_teams_are_large_and_unlike() -> None:
    teams = large_teams()
    assert [len(team.robots) for team in teams] == [LARGE] * TEAMS
    assert all(one != other for k, one in enumerate(teams) for other in teams[:k])


def test_scripts_have_their_own_scores() -> None:
    team = large_teams()[0]
    names = ("random", "hungarian", "greedy")
    least, most, greedy = scores([scripted_policy(name, team, 20_261) for name in names], team, 30)
    assert least == pytest.approx(0.0, abs=1e-9)
    assert most == pytest.approx(1.0)
    assert 0.0 < greedy < 1.5
