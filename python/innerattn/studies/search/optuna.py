"""What Optuna does for a search: it proposes values, and keeps a journal for its own tools."""

from __future__ import annotations

import os
import secrets
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from innerattn.errors import missing_library
from innerattn.studies.search.race import Standing
from innerattn.studies.space import Choice, Range, Search, Value

_DIGITS = 4


def load_optuna() -> Any:
    """The library.

    Raises:
        MissingLibraryError: it is not installed.
    """
    try:
        import optuna
    except ModuleNotFoundError as error:
        raise missing_library("[search]", error) or error from error
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    return optuna


def propose(search: Search, standings: Sequence[Standing], number: int) -> dict[str, Value]:
    """The values of the trial with a number, by Optuna's TPE sampler.

    The same standings and number give the same values.

    Args:
        search: what is drawn from.
        standings: of all trials so far; of the recipe, its values in the space.
        number: of the trial; seed of the sampler.

    Raises:
        MissingLibraryError: Optuna is not installed.
    """
    optuna = load_optuna()
    study = optuna.create_study(
        direction=search.direction, sampler=optuna.samplers.TPESampler(seed=number)
    )
    _tell(optuna, study, search, standings)
    drawn = study.ask(_distributions(optuna, search)).params
    return {key: _rounded(search.space[key], value) for key, value in drawn.items()}


def write_journal(search: Search, standings: Sequence[Standing], path: Path, name: str) -> None:
    """Write all trials as a journal of Optuna, which optuna-dashboard shows.

    Args:
        search: what is drawn from.
        standings: of all trials.
        path: of the file; it is replaced whole.
        name: of the study in it.

    Raises:
        MissingLibraryError: Optuna is not installed.
        OSError: the file cannot be written.
    """
    optuna = load_optuna()
    partial = path.with_name(f".{path.name}.{secrets.token_hex(8)}")
    try:
        journal = optuna.storages.journal
        storage = optuna.storages.JournalStorage(journal.JournalFileBackend(str(partial)))
        study = optuna.create_study(direction=search.direction, storage=storage, study_name=name)
        _tell(optuna, study, search, standings)
        os.replace(partial, path)
    finally:
        partial.unlink(missing_ok=True)


def _tell(optuna: Any, study: Any, search: Search, standings: Sequence[Standing]) -> None:
    """Tell a study of Optuna all trials whose values are in the space."""
    distributions = _distributions(optuna, search)
    states = optuna.trial.TrialState
    names = {
        "open": states.RUNNING,
        "finished": states.COMPLETE,
        "dropped": states.PRUNED,
        "failed": states.FAIL,
    }
    for one in standings:
        values = one.trial.values_of(search)
        inside = all(key in values and values[key] in drawn for key, drawn in search.space.items())
        if not inside or values.keys() != search.space.keys():  # the space was another one then
            continue
        mean = one.mean.mean if one.mean is not None else None
        told = one.state in ("finished", "dropped")
        study.add_trial(
            optuna.trial.create_trial(
                state=names[one.state],
                value=mean if one.state == "finished" else None,
                params=values,
                distributions=distributions,
                intermediate_values={len(one.scores): mean} if told else {},
                user_attrs={"trial": one.trial.name},
            )
        )


def _distributions(optuna: Any, search: Search) -> dict[str, Any]:
    kinds = optuna.distributions
    found = {}
    for key, drawn in search.space.items():
        if isinstance(drawn, Choice):
            found[key] = kinds.CategoricalDistribution(list(drawn))
        else:
            kind = kinds.IntDistribution if drawn.whole else kinds.FloatDistribution
            found[key] = kind(drawn.low, drawn.high, log=drawn.log)
    return found


def _rounded(drawn: Range | Choice, value: Value) -> Value:
    """A number with few digits, which a user can write again."""
    if isinstance(drawn, Choice) or drawn.whole or not isinstance(value, float):
        return value
    return min(max(float(f"{value:.{_DIGITS}g}"), float(drawn.low)), float(drawn.high))
