"""Which finished runs of a study are still to be measured, and what was found in others."""

from __future__ import annotations

from collections.abc import Mapping

from innerattn.studies.actor_attention import RunAttention
from innerattn.studies.faults import RunUnderFaults
from innerattn.studies.folder import StudyFolder
from innerattn.studies.measurement import Measurement
from innerattn.studies.plan import PlannedRun
from innerattn.studies.teams import RunInTeams

_KINDS: tuple[type[Measurement], ...] = (RunUnderFaults, RunInTeams, RunAttention)


def to_measure(study: StudyFolder) -> list[Measurement]:
    """What finished runs lack of the measurements that a study asks for; nothing is read.

    Archived runs have no weights, so they cannot be measured.
    """
    first = {run.key: run for run in reversed(study.planned) if (study.runs / run.key).exists()}
    found = [kind.of(study, run) for run in reversed(first.values()) for kind in _KINDS]
    return [one for one in found if one is not None and not one.path.exists()]


def measured(study: StudyFolder, run: PlannedRun) -> Mapping[str, float | None]:
    """What was found of a run, by measure; empty where it has not been measured.

    Raises:
        RunError: a file is damaged.
        OSError: a file cannot be read.
    """
    found = [kind.of(study, run) for kind in _KINDS]
    there = [one for one in found if one is not None and one.path.exists()]
    return {name: value for one in there for name, value in one.read()}
