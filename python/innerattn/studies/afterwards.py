"""Which finished runs of a study are still to be measured, and what was found in others."""

from __future__ import annotations

from typing import Any

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


def measured(study: StudyFolder, run: PlannedRun) -> dict[str, float | None]:
    """What was found of a run, by measure; empty where it has not been measured.

    Raises:
        RunError: a document is damaged.
        OSError: a file cannot be read.
    """
    there = _there(study, run)
    return {
        name: value for one, document in there for name, value in one.values_in(document).items()
    }


def documents(study: StudyFolder, run: PlannedRun) -> dict[str, Any]:
    """All that was found of a run, by the name of its file in the study's folder.

    Raises:
        RunError: a document is damaged.
        OSError: a file cannot be read.
    """
    return {one.name: document for one, document in _there(study, run)}


def _there(study: StudyFolder, run: PlannedRun) -> list[tuple[Measurement, dict[str, Any]]]:
    found = [one for kind in _KINDS if (one := kind.of(study, run)) is not None]
    return [(one, document) for one in found if (document := one.document(study)) is not None]
