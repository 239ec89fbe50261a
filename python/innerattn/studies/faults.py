"""Finished runs of a study under faults."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar, Self

from innerattn.studies.folder import StudyFolder
from innerattn.studies.measurement import Measurement
from innerattn.studies.plan import PlannedRun
from innerattn.studies.study import RETAINED, Faults


@dataclass
class RunUnderFaults(Measurement):
    """A finished run that is to meet faults.

    Attributes:
        faults: which ones it meets.
    """

    section: ClassVar[str] = Faults.place
    values_key: ClassVar[str] = "retained"
    damaged: ClassVar[str] = "a measurement under faults"

    faults: Faults

    def measured(self, report: Callable[[float], None]) -> dict[str, Any]:
        """Play the worlds: what is retained."""
        from innerattn.evaluate.faults.grid import Grid, play_all
        from innerattn.evaluate.trained import load_trained

        config = self.run.config
        steps = 2 * config.scenario.episode_steps
        worlds = config.scenario.replace(episode_steps=steps, faults=())
        grid = Grid(
            worlds, self.faults.kinds, episodes=self.faults.episodes, seed=config.evaluate.seed
        )
        _, policy = load_trained(self.folder, worlds)
        retention = play_all(
            [("run", policy)],
            grid,
            num_threads=config.train.threads,
            progress=lambda done, total: report(done / total),
        )["run"]
        each = retention.by_kind()
        values = {kind: _finite(each[k].value) for k, kind in enumerate(grid.kinds)}
        known = [value for value in values.values() if value is not None]
        whole = sum(known) / len(known) if len(known) == len(values) else None
        kinds = {f"{RETAINED}_{kind}": value for kind, value in values.items()}
        return {
            "episodes": grid.episodes,
            "episode_steps": steps,
            self.values_key: {RETAINED: whole, **kinds},
        }

    @classmethod
    def of(cls, study: StudyFolder, run: PlannedRun) -> Self | None:
        """That of a run; None where the study has no faults."""
        if (faults := study.study.faults) is None:
            return None
        rules = {"kinds": list(faults.kinds), "episodes": faults.episodes}
        path = cls.file(study, run, rules)
        return cls(run=run, folder=study.runs / run.key, path=path, faults=faults)


def _finite(value: Any) -> float | None:
    number = float(value)
    return number if abs(number) < float("inf") else None
