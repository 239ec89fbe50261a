"""What Optuna proposes, and the journal for its tools."""

import statistics
import sys
import warnings
from pathlib import Path

import pytest

from innerattn.errors import MissingLibraryError
from innerattn.stats.seeds import seed_estimate
from innerattn.studies.search.optuna import propose, write_journal
from innerattn.studies.search.race import Standing, State
from innerattn.studies.search.trials import Trial
from innerattn.studies.space import Search, Value

SEARCH = Search.model_validate(
    {
        "ppo": {
            "learning_rate": {"low": 1e-4, "high": 1e-1, "log": True},
            "epochs": {"low": 1, "high": 4},
        },
        "network": {"encoder": ["flat", "entities"]},
    }
)


def standing(number: int, values: dict[str, Value], score: float, state: State) -> Standing:
    mean = seed_estimate([score - 0.01, score + 0.01])
    return Standing(Trial(number, values, ()), {0: score - 0.01, 1: score + 0.01}, mean, state)


def searched(trials: int) -> list[Standing]:
    """A search whose best value is a learning rate of 0.01."""
    found: list[Standing] = []
    for number in range(1, trials + 1):
        values = propose(SEARCH, found, number)
        rate = values["ppo.learning_rate"]
        assert isinstance(rate, float)
        found.append(standing(number, values, 1.0 - abs(rate - 0.01), "finished"))
    return found


def test_proposals_are_in_the_space_come_again_and_get_better() -> None:
    found = searched(30)
    for one in found:
        values = one.trial.values
        assert values.keys() == SEARCH.space.keys()
        assert all(value in SEARCH.space[key] for key, value in values.items())
        assert float(f"{values['ppo.learning_rate']:.4g}") == values["ppo.learning_rate"]
    assert [one.trial.values for one in searched(12)] == [one.trial.values for one in found[:12]]
    errors = [1.0 - (one.mean.mean if one.mean else 0.0) for one in found]
    assert statistics.median(errors[20:]) < 0.5 * statistics.median(errors[:10])


def test_other_spaces_and_failures_do_no_harm() -> None:
    known = [
        standing(1, {"ppo.learning_rate": 0.01}, 0.9, "finished"),  # the space had one key then
        standing(
            2,
            {"ppo.learning_rate": 0.5, "ppo.epochs": 2, "network.encoder": "flat"},  # outside
            0.9,
            "finished",
        ),
        Standing(Trial(3, {}, (), "cannot be run"), {}, None, "failed"),
    ]
    assert propose(SEARCH, known, 4) == propose(SEARCH, [], 4)


def test_the_journal_is_read_by_optuna(tmp_path: Path) -> None:
    import optuna

    values: dict[str, Value] = {
        "ppo.learning_rate": 0.01,
        "ppo.epochs": 2,
        "network.encoder": "flat",
    }
    found = [
        standing(1, values, 0.9, "finished"),
        standing(2, values | {"ppo.epochs": 3}, 0.2, "dropped"),
        Standing(Trial(3, values, ()), {}, None, "failed"),
        Standing(Trial(4, values, ()), {}, None, "open"),
    ]
    for _ in range(2):  # it is replaced, not added to
        write_journal(SEARCH, found, tmp_path / "optuna.log", "mine")
    assert [one.name for one in tmp_path.iterdir()] == ["optuna.log"]
    backend = optuna.storages.journal.JournalFileBackend(str(tmp_path / "optuna.log"))
    study = optuna.load_study(study_name="mine", storage=optuna.storages.JournalStorage(backend))
    assert [one.state.name for one in study.trials] == ["COMPLETE", "PRUNED", "FAIL", "RUNNING"]
    assert study.best_params == values
    assert study.best_value == pytest.approx(0.9)
    assert study.trials[1].intermediate_values == {2: pytest.approx(0.2)}
    assert study.trials[1].user_attrs == {"trial": "trial-2"}


def test_no_warning_and_no_line_is_printed(capfd: pytest.CaptureFixture[str]) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        propose(SEARCH, searched(12), 13)
    assert capfd.readouterr() == ("", "")


def test_without_optuna_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "optuna", None)
    with pytest.raises(MissingLibraryError, match=r"pip install 'innerattn\[search\]'"):
        propose(SEARCH, [], 1)
