"""The race of a search: who is dropped, who goes on, who is best."""

import statistics
from collections.abc import Sequence

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from innerattn.studies.search.race import Standing, best_of, next_seeds, race
from innerattn.studies.search.trials import Trial
from innerattn.studies.space import Search

SEEDS = (3, 1, 4, 1_5, 9)


def search(direction: str = "maximize") -> Search:
    return Search.model_validate(
        {"direction": direction, "ppo": {"gamma": {"low": 0.9, "high": 0.99}}}
    )


def interval(scores: Sequence[float]) -> tuple[float, float]:
    """Student's, by scipy."""
    mean, error = statistics.mean(scores), stats.sem(scores)
    half = stats.t.ppf(0.975, len(scores) - 1) * error if error else 0.0
    return mean - half, mean + half


def played(rows: Sequence[Sequence[float]], direction: str = "maximize") -> list[Standing]:
    """A whole race in which each trial has a score for each seed."""
    trials = [Trial(number, {}, ()) for number in range(len(rows))]
    scores: dict[Trial, dict[int, float]] = {trial: {} for trial in trials}
    while True:
        standings = race(search(direction), SEEDS, scores, [])
        asked = [(one.trial, next_seeds(one, SEEDS)) for one in standings]
        if not any(seeds for _, seeds in asked):
            return standings
        for trial, seeds in asked:
            for seed in seeds:
                scores[trial][seed] = rows[trial.number][SEEDS.index(seed)]


def test_what_is_clearly_worse_costs_two_seeds() -> None:
    good, bad = (0.9, 0.91, 0.89, 0.9, 0.92), (0.1, 0.11, 0.1, 0.12, 0.1)
    standings = played([good, bad, good[::-1], bad])
    assert [one.state for one in standings] == ["finished", "dropped", "finished", "dropped"]
    assert [len(one.scores) for one in standings] == [5, 2, 5, 2]
    assert list(standings[1].scores) == [3, 1], "the first seeds, in their order"
    recipe_bad = played([bad, good])
    assert [one.state for one in recipe_bad] == ["finished", "finished"], "the recipe stays"


def test_the_difference_over_shared_seeds_counts() -> None:
    """Seeds differ far more than trials, as where their worlds do."""
    best = (0.9, 0.1, 0.5, 0.7, 0.3)
    standings = played([best, tuple(score - 0.05 for score in best), (0.8, 0.15, 0.5, 0.7, 0.3)])
    assert [one.state for one in standings] == ["finished", "dropped", "finished"]


def test_smaller_may_be_better() -> None:
    low, high = (0.1, 0.11, 0.1, 0.12, 0.1), (0.9, 0.91, 0.89, 0.9, 0.92)
    standings = played([high, low, high], "minimize")
    assert [one.state for one in standings] == ["finished", "finished", "dropped"]
    best = best_of(search("minimize"), standings)
    assert best is not None
    assert best.trial.number == 1


def test_the_first_of_equals_is_best_and_no_finished_trial_none() -> None:
    same = (0.5, 0.6, 0.7, 0.5, 0.6)
    best = best_of(search(), played([same, same]))
    assert best is not None
    assert best.trial.number == 0
    assert best_of(search(), race(search(), SEEDS, {Trial(0, {}, ()): {}}, [])) is None


def test_who_has_failed_is_out_and_nobodys_measure() -> None:
    trials = [Trial(number, {}, ()) for number in range(3)]
    scores = {
        trials[0]: {3: 0.5, 1: 0.51},
        trials[1]: {3: 5.0, 1: 5.0},  # better than all, but a run of it failed
        trials[2]: {3: 0.4},
    }
    standings = race(search(), SEEDS, scores, [trials[1]])
    assert [one.state for one in standings] == ["open", "failed", "open"]
    assert [next_seeds(one, SEEDS) for one in standings] == [[4], [], [1]]


@given(
    st.lists(
        st.lists(st.floats(-1, 2).map(lambda x: round(x, 3)), min_size=5, max_size=5),
        min_size=1,
        max_size=8,
    ),
    st.sampled_from(["maximize", "minimize"]),
)
def test_every_race_ends_by_its_rule(rows: list[list[float]], direction: str) -> None:
    """Held against Student's interval of scipy, trial by trial."""
    standings = played(rows, direction)
    sign = 1.0 if direction == "maximize" else -1.0
    means = [sign * statistics.mean(one.scores.values()) for one in standings]
    leader = standings[means.index(max(means))].scores
    for one in standings:
        assert one.state in ("finished", "dropped")
        if one.state == "finished":
            assert len(one.scores) == 5
        else:
            assert one.trial.number > 0
            assert 2 <= len(one.scores) < 5
            gains = [sign * (score - leader[seed]) for seed, score in one.scores.items()]
            assert interval(gains)[1] <= 1e-9
    best = best_of(search(direction), standings)
    assert best is not None
    finished = [m for one, m in zip(standings, means, strict=True) if one.state == "finished"]
    assert sign * statistics.mean(best.scores.values()) == pytest.approx(max(finished))
