"""Finished runs of a study in teams that they have never met."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar, Self

from innerattn.studies.folder import StudyFolder
from innerattn.studies.measurement import Measurement
from innerattn.studies.plan import PlannedRun
from innerattn.studies.study import UNSEEN, UnseenTeams


@dataclass
class RunInTeams(Measurement):
    """A finished run that is to act in unseen teams.

    Attributes:
        episodes: in each team.
    """

    section: ClassVar[str] = UnseenTeams.place
    damaged: ClassVar[str] = "a measurement in unseen teams"

    episodes: int

    def measured(self, report: Callable[[float], None]) -> dict[str, Any]:
        """Play the worlds: the scores of all teams, their means and the least."""
        from innerattn.evaluate.trained import load_trained
        from innerattn.evaluate.unseen_teams import GROUPS, scores_in_unseen_teams, unseen_teams

        found = list(
            scores_in_unseen_teams(
                lambda scenario: load_trained(self.folder, scenario)[1],
                self.episodes,
                num_threads=self.run.config.train.threads,
                progress=lambda done: report(done / len(unseen_teams())),
            )
        )
        scores = [one.score for one in found]
        groups = {
            group: [one.score for one in found if one.team.group == group] for group in GROUPS
        }
        return {
            "episodes": self.episodes,
            "scores": scores,
            self.values_key: {
                UNSEEN: sum(scores) / len(scores),
                f"{UNSEEN}_worst": min(scores),
                **{f"{UNSEEN}_{group}": sum(own) / len(own) for group, own in groups.items()},
            },
        }

    @classmethod
    def of(cls, study: StudyFolder, run: PlannedRun) -> Self | None:
        """That of a run; None where the study does not ask it to meet unseen teams."""
        teams = study.study.unseen_teams
        if teams is None or not teams.takes(run.config):
            return None
        path = cls.file(study, run, {"episodes": teams.episodes})
        return cls(run=run, folder=study.runs / run.key, path=path, episodes=teams.episodes)
