"""Workers of a study as processes of this machine."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from innerattn.errors import RunError
from innerattn.experiments.processes import Job, run_side_by_side

_MOST_ROUNDS = 5


@dataclass
class _Worker(Job):
    """A worker for the study in a folder."""

    folder: Path
    until: float | None

    def do(self, report: Callable[[float], None]) -> None:
        """Work until nothing is left to do, time is up, or nobody listens any more."""
        from innerattn.studies.folder import open_study
        from innerattn.studies.search.state import Watched
        from innerattn.studies.work import work

        study = open_study(self.folder)
        work(study.ledger(), Watched(study).to_do(), until=self.until, report=report)


def run_workers(
    folder: Path, count: int, *, left: Callable[[], int], most_s: float | None = None
) -> None:
    """Let workers do what is left of a study; those that die are replaced once the others are done.

    Args:
        folder: of the study.
        count: how many.
        left: gives the number of runs that are neither done nor failed; called often.
        most_s: time after which workers save their runs and end [s]; None: there is no limit.

    Raises:
        RunError: workers die again and again while no run ends.
        KeyboardInterrupt: after all workers have saved their runs and are gone; a second one ends
            them at once.
    """

    def changed(_: Sequence[_Worker]) -> None:
        left()

    until = None if most_s is None else time.monotonic() + most_s
    rounds, before = 0, left()
    while before and (until is None or time.monotonic() < until):
        workers = [_Worker(folder, until) for _ in range(min(count, before))]
        run_side_by_side(workers, count, changed=changed, failed=lambda _: None)
        now = left()
        rounds, before = (rounds + 1 if now == before else 0), now
        if rounds == _MOST_ROUNDS:
            raise RunError(f"{folder}: no run ends, because {workers[0].failure or 'workers stop'}")
