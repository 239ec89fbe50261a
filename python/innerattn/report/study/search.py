"""What a search found: its trials by rank, what they cost, and the best one against the recipe."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import accumulate
from typing import Any

from innerattn.report.table import Table, columns, markdown, plain_table
from innerattn.report.tables.text import plus_minus
from innerattn.stats.estimate import as_json
from innerattn.stats.text import NONE
from innerattn.studies.folder import StudyFolder
from innerattn.studies.results import Compared, Result, compare
from innerattn.studies.search.race import RULES, Standing
from innerattn.studies.search.state import Now, SearchState
from innerattn.studies.space import Search
from innerattn.studies.study import Study, StudyContrast

_ORDER = ("finished", "open", "dropped", "failed")


@dataclass(frozen=True)
class SearchFound:
    """What a report says of a search.

    Attributes:
        study: in its folder.
        search: what was asked.
        state: how it stands.
        core_s: time of training of each trial's runs in the race, by number [core-seconds].
        confirmed: the best trial against the recipe with further seeds, for each scenario; empty
            as long as none is chosen, or where the recipe is best.
    """

    study: StudyFolder
    search: Search
    state: SearchState
    core_s: Mapping[int, float]
    confirmed: Sequence[Compared]

    @property
    def ranked(self) -> list[Standing]:
        """All trials: those with all seeds first, then by their means."""
        sign = -1.0 if self.search.direction == "maximize" else 1.0

        def rank(one: Standing) -> tuple[int, float, int]:
            mean = 0.0 if one.mean is None else sign * one.mean.mean
            return _ORDER.index(one.state), mean, one.trial.number

        return sorted(self.state.standings, key=rank)

    @property
    def spent_core_s(self) -> list[float]:
        """Core-seconds of all trials up to each one, in the order of their numbers."""
        return list(accumulate(self.core_s[one.trial.number] for one in self.state.standings))


def search_found(now: Now, results: Sequence[Result]) -> SearchFound:
    """What a search found.

    Args:
        now: how far a study with a search is.
        results: its finished runs; without records there are no costs of them.
    """
    study, search, state = now.study, now.study.study.search, now.search
    assert search is not None
    assert state is not None
    racing = set(study.study.grid[0].numbers)
    core_s = dict.fromkeys((one.trial.number for one in state.standings), 0.0)
    numbers = {one.trial.name: one.trial.number for one in state.standings}
    for one in results:
        if one.finished is not None and one.run.seed in racing:
            info = one.finished.info
            core_s[numbers[str(one.run.place["variant"])]] += info.seconds * info.threads
    return SearchFound(
        study, search, state, core_s, _confirmed(study.study, search, state, results)
    )


def _confirmed(
    study: Study, search: Search, state: SearchState, results: Sequence[Result]
) -> list[Compared]:
    if state.best is None or not state.best.trial.number:
        return []
    best, recipe = state.best.trial, state.standings[0].trial
    contrast = StudyContrast(
        name="best trial against the recipe",
        a={"variant": best.name},
        b={"variant": recipe.name},
        measure=search.measure,
        length=search.length,
        margin=search.margin,
    )
    further = set(search.confirm_seeds)
    return compare(
        study.model_copy(update={"contrasts": (contrast,)}),
        [run for trial in (best, recipe) for run in trial.runs if run.seed in further],
        [one for one in results if one.run.seed in further],
    )


def search_sentences(found: SearchFound) -> list[str]:
    """What the search says, in Markdown, before any comparison."""
    state, search = found.state, found.search
    of = f"{len(state.standings) - 1} of {search.trials} trials"
    if state.best is None:
        return [f"{of} are proposed. None is chosen before all have ended."]
    measure = search.measure.replace("_", " ")
    recipe, best = state.standings[0], state.best
    told = [f"{plus_minus(one.mean)} over {len(one.scores)} seeds" for one in (best, recipe)]
    if not best.trial.number:
        return [f"No trial of {search.trials} is better than the recipe: {measure} {told[1]}."]
    return [f"**{best.trial.name}** is the best of {of}: {measure} {told[0]}; recipe {told[1]}."]


def search_page(found: SearchFound, figure: str | None) -> list[str]:
    """The parts of a page.

    Args:
        found: what it shows.
        figure: file of its figure.
    """
    parts = []
    if found.state.best is not None and found.state.best.trial.number:
        parts += ["Train with its values:\n", f"```sh\n{train_command(found)}\n```\n"]
    if figure is not None:
        parts += [f"![Score against cost]({figure})\n", _FIGURE]
    parts += ["## Trials\n", markdown(search_table(found)), _COST]
    parts += [
        f"{one.trial.name} cannot be run: {one.trial.refused}.\n"
        for one in found.ranked
        if one.trial.refused
    ]
    return parts


_COST = (
    "± is half the 95 % interval over seeds (Student's t). Core-seconds are those of training in "
    "the race. A trial that was dropped has fewer seeds.\n"
)
_FIGURE = (
    "Trials in the order of their proposals, against the core-seconds of all until then. The line "
    "is the best mean so far of those with all seeds.\n"
)


def search_table(found: SearchFound, *, cost: bool = True) -> Table:
    """All trials by rank; ``cost``: with what they cost."""
    keys = list(found.search.space)
    rows = []
    for one in found.ranked:
        values = one.trial.values_of(found.search)
        rows.append(
            [
                one.trial.name,
                *(NONE if key not in values else str(values[key]) for key in keys),
                str(len(one.scores)),
                NONE if one.mean is None else plus_minus(one.mean),
                *([f"{found.core_s[one.trial.number]:.0f}"] if cost else []),
                "done" if one.state == "finished" else one.state,  # short: it is a wide table
            ]
        )
    measure = found.search.measure.replace("_", " ")
    heads = [*(key.rpartition(".")[2].replace("_", " ") for key in keys), "seeds", measure]
    return plain_table(columns(["trial"], [*heads, *["core-s"] * cost, "state"]), rows)


def train_command(found: SearchFound) -> str:
    """The command that trains with the values of the best trial."""
    assert found.state.best is not None
    grid = found.study.study.grid[0]
    values = {key: values[0] for key, values in grid.keys.items()}
    values |= found.state.best.trial.values
    scenario = grid.scenarios[0]
    where = ["--scenario", scenario] if scenario.endswith(".toml") else ["--preset", scenario]
    words = ["innerattn", "train", *where, "--method", grid.methods[0], "--budget", grid.budgets[0]]
    for key, value in values.items():
        words += [f"--{key.replace('_', '-')}", str(value)]
    return shlex.join(words)


def search_document(found: SearchFound) -> dict[str, Any]:
    """The same as a JSON document."""
    state = found.state
    return {
        **found.search.model_dump(mode="json"),
        "best": None if state.best is None else state.best.trial.name,
        "left_to_propose": state.to_propose,
        "trials": [
            {
                "name": one.trial.name,
                "values": dict(one.trial.values),
                "scores": {str(seed): score for seed, score in one.scores.items()},
                "mean": as_json(one.mean),
                "core_s": found.core_s[one.trial.number],
                "state": one.state,
                "refused": one.trial.refused,
            }
            for one in state.standings
        ],
    }


def search_rules(search: Search) -> str:
    """The rules of its race, as a list in Markdown."""
    told = ", ".join(map(str, search.confirm_seeds))
    return f"{RULES}\n- **Further seeds** are {told}."
