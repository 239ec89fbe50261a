"""How a search stands in its study's folder, and which runs it asks for now."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

from innerattn.studies.folder import StudyFolder
from innerattn.studies.ledger import State as RunState
from innerattn.studies.plan import PlannedRun
from innerattn.studies.results import read_summaries
from innerattn.studies.search.optuna import propose
from innerattn.studies.search.race import Standing, best_of, next_seeds, race
from innerattn.studies.search.trials import Trial, add_values, plan, read_values
from innerattn.studies.space import Value


@dataclass(frozen=True)
class SearchState:
    """How a search stands.

    Attributes:
        standings: of all trials, the recipe first.
        best: the best of those with all seeds, once no trial is open or to be proposed; else None.
        wanted: runs that it asks for and that have no result.
        asked: all runs that it asks for or has asked for, in the order of trials and seeds.
        states: of these runs by key.
        to_propose: how many trials are still to be proposed.
    """

    standings: Sequence[Standing]
    best: Standing | None
    wanted: Sequence[PlannedRun]
    asked: Sequence[PlannedRun]
    states: dict[str, RunState]
    to_propose: int

    @property
    def idle(self) -> bool:
        """Whether nothing that it asks for is free to be worked on."""
        return all(self.states[run.key] != "planned" for run in self.wanted)


class Searching:
    """The runs that a search asks for; each iteration looks anew, and proposes a trial if needed.

    Args:
        study: a study with a search, in its folder.
    """

    def __init__(self, study: StudyFolder) -> None:
        assert study.study.search is not None
        self._study, self._search = study, study.study.search
        self._plans: dict[int, Trial] = {}
        self._values: dict[str, float | None] = {}

    def look(self) -> SearchState:
        """How it stands now.

        Raises:
            RunError: a trial or the result of a run cannot be read.
            OSError: a file cannot be read.
        """
        trials = self._trials()
        runs = [run for trial in trials for run in trial.runs]
        study = replace(self._study, planned=runs)
        states = study.states()
        seeds = study.study.grid[0].numbers
        self._read(study, [run for run in runs if states[run.key] == "done"])
        scores: dict[Trial, dict[int, float]] = {}
        failed = [trial for trial in trials if trial.refused]
        for trial in trials:
            scores[trial] = {}
            for seed in seeds if not trial.refused else ():
                own = trial.of_seed(seed)
                if any(states[run.key] == "failed" for run in own):
                    failed.append(trial)
                if any(states[run.key] != "done" for run in own):
                    continue
                values = [self._values[run.key] for run in own]
                known = [value for value in values if value is not None]
                if len(known) < len(values):
                    failed.append(trial)
                else:
                    scores[trial][seed] = sum(known) / len(known)
        standings = race(self._search, seeds, scores, failed)
        return self._state(standings, states)

    def _state(self, standings: Sequence[Standing], states: dict[str, RunState]) -> SearchState:
        study = self._study.study
        seeds = study.grid[0].numbers
        to_propose = max(0, self._search.trials - (len(standings) - 1))
        wanted = [
            run
            for one in standings
            for seed in next_seeds(one, seeds)
            for run in one.trial.of_seed(seed)
            if states[run.key] != "done"
        ]
        best = None
        if not wanted and not to_propose:
            best = best_of(self._search, standings)
        if best is not None and best.trial.number:
            recipe = standings[0].trial
            wanted = [
                run
                for seed in self._search.confirm_seeds
                for trial in (recipe, best.trial)
                for run in trial.of_seed(seed)
                if states[run.key] not in ("done", "failed")
            ]
        keys = {run.key for run in wanted}
        asked = [
            run
            for one in standings
            for run in one.trial.runs
            if run.key in keys or states[run.key] != "planned"
        ]
        now = {run.key: states[run.key] for run in asked}
        return SearchState(standings, best, wanted, asked, now, to_propose)

    def __iter__(self) -> Iterator[PlannedRun]:
        """The runs that it asks for, after a new trial where all of them are being worked on.

        Raises:
            MissingLibraryError: Optuna is not installed.
            RunError: a trial or the result of a run cannot be read.
            OSError: a file cannot be read or written.
        """
        found = self.look()
        while found.to_propose and found.idle:
            number = found.standings[-1].trial.number + 1
            values = propose(self._search, found.standings, number)
            add_values(self._study, number, values)  # or another worker was faster
            found = self.look()
        return iter(found.wanted)

    def _read(self, study: StudyFolder, done: Sequence[PlannedRun]) -> None:
        """Read the results of finished runs, each once: several looks a second are usual."""
        search = self._search
        new = [run for run in done if run.key not in self._values]
        for one in read_summaries(replace(study, planned=new)) if new else ():
            self._values[one.run.key] = one.value(search.measure, search.length)

    def _trials(self) -> list[Trial]:
        values: dict[int, dict[str, Value]] = {0: {}} | read_values(self._study)
        for number in values.keys() - self._plans.keys():
            self._plans[number] = plan(self._study, number, values[number])
        return [self._plans[number] for number in values]


@dataclass(frozen=True)
class Now:
    """How far a study is.

    Attributes:
        study: with the runs that its search asks for now, if it has one.
        states: of these runs by key.
        left: how many runs have no result and have not failed; of a search the most it may be.
        search: how its search stands; None of a study without one.
    """

    study: StudyFolder
    states: dict[str, RunState]
    left: int
    search: SearchState | None = None


class Watched:
    """A study that is looked at again and again, while its search may ask for other runs.

    Args:
        study: in its folder.
    """

    def __init__(self, study: StudyFolder) -> None:
        self._study = study
        self._searching = None if study.study.search is None else Searching(study)

    def now(self) -> Now:
        """How far it is.

        Raises:
            RunError: a trial or the result of a run cannot be read.
            OSError: a file cannot be read.
        """
        study = self._study
        if self._searching is None:
            states = study.states()
            left = sum(one not in ("done", "failed") for one in states.values())
            return Now(study, states, left)
        found = self._searching.look()
        now = replace(study, planned=list(found.asked))
        return Now(now, found.states, self._most_left(found), found)

    def to_do(self) -> Iterable[PlannedRun]:
        """What a worker is to do, to be iterated before each claim."""
        return self._study.to_do if self._searching is None else self._searching

    def _most_left(self, found: SearchState) -> int:
        """How many runs a search may still ask for, if no trial is dropped."""
        search, grid = self._study.study.search, self._study.study.grid[0]
        assert search is not None
        missing = (
            len(grid.numbers) - len(one.scores) for one in found.standings if one.state == "open"
        )
        racing = sum(missing) + found.to_propose * len(grid.numbers)
        if not racing:
            return len(found.wanted)
        return (racing + 2 * len(search.confirm_seeds)) * len(grid.scenarios)
