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

    looks = time_to_score.measure(training(clock, 47), score, most_seconds, 5.0)
    name, *reached, last, speed = time_to_score.row("a team", looks)
    assert (name, speed) == ("a team", "100")
    if most_seconds == 30.0:
        assert [look.seconds for look in looks] == [5.0, 10.0, 15.0, 20.0, 25.0, 30.0]
        assert (reached, last) == (["25 s", "–", "–", "–"], "0.60")
    else:  # looked at every 5 s, and once at the end
        assert looks[-1] == (47.0, 4_700, pytest.approx(0.94))
        assert (reached, last) == (["25 s", "35 s", "40 s", "45 s"], "0.94")


def test_the_figure_has_every_team_and_both_scripts() -> None:
    looks = [time_to_score.Look(10.0, 500, 0.5), time_to_score.Look(20.0, 1_000, 0.7)]
    figure = time_to_score.draw({"one": looks, "other": looks[:1]}, 0.8)
    by_time, by_steps = figure.axes
    for panel, times in ((by_time, [10.0, 20.0]), (by_steps, [500.0, 1_000.0])):
        drawn = {line.get_label(): line for line in panel.get_lines()}
        assert drawn["one"].get_xdata().tolist() == times
        assert drawn["one"].get_ydata().tolist() == [0.5, 0.7]
        assert drawn["other"].get_ydata().tolist() == [0.5]
        assert [(text.get_text(), text.xy[1]) for text in panel.texts] == [
            ("hungarian", 1.0),
            ("greedy", 0.8),
        ]
