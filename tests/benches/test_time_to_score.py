"""The clock of the benchmark of time to a score."""

from collections.abc import Iterator

import pytest
import time_to_score
import torch


class Clock:
    """Seconds that pass when somebody says so."""

    now = 0.0

    def perf_counter(self) -> float:
        return self.now


class Team:
    """Better with every second of training."""

    def __init__(self) -> None:
        self.level = 0.0

    def act(self, obs: torch.Tensor, greedy: bool = False) -> torch.Tensor:
        raise NotImplementedError


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    made = Clock()
    monkeypatch.setattr(time_to_score, "time", made)
    return made


def training(clock: Clock, steps: int) -> Iterator[tuple[int, Team]]:
    team = Team()
    for step in range(1, steps + 1):
        clock.now += 1.0
        team.level += 0.02
        yield 100 * step, team


@pytest.mark.parametrize("most_seconds", [30.0, 1_000.0])
def test_the_clock_stands_still_while_a_team_is_measured(clock: Clock, most_seconds: float) -> None:
    def score(team: time_to_score.Acting) -> float:
        clock.now += 500.0
        assert isinstance(team, Team)
        return team.level

    found, last, speed = time_to_score.measure(training(clock, 47), score, most_seconds, 5.0)
    if most_seconds == 30.0:
        assert found == {0.5: 25.0}
        assert last == pytest.approx(0.6)
    else:  # looked at every 5 s, and once at the end
        assert found == {0.5: 25.0, 0.7: 35.0, 0.8: 40.0, 0.9: 45.0}
        assert last == pytest.approx(0.94)
    assert speed == pytest.approx(100.0)
