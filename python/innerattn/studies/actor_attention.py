"""The attention in the actors of finished runs of a study: handoffs, and attended robots that fail.

Steps are those of episodes of twice the usual length; robots fail when half of it is over.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from innerattn.measures.sharing.handoff import (
    REACH,
    all_handoffs,
    rescues_nobody,
    with_control,
)
from innerattn.measures.sharing.partner_lead import AFTER, BEFORE, mean_lead, partner_leads
from innerattn.records.record import Record
from innerattn.stats.seeds import SeedCurve, seed_curve
from innerattn.studies.folder import StudyFolder
from innerattn.studies.measurement import Measurement
from innerattn.studies.plan import PlannedRun
from innerattn.studies.study import ACTOR, RETAINED, ActorAttention

OFFSETS = np.arange(1 - REACH, REACH + 1)
"""(W,) steps since the first rescue's of a handoff that are looked at."""

_FIELD = "actor_attention"


@dataclass
class RunAttention(Measurement):
    """A finished run in whose actors there is attention.

    Attributes:
        episodes: how many are played, without a failure and with each.
    """

    section: ClassVar[str] = ActorAttention.place
    damaged: ClassVar[str] = "a measurement of attention in the actor"

    episodes: int

    def measured(self, report: Callable[[float], None]) -> dict[str, Any]:
        """Play the worlds: leads around handoffs, and what is retained when robots fail."""
        from innerattn.evaluate.faults.attended import play_failures
        from innerattn.evaluate.trained import load_trained

        config = self.run.config
        onset = config.scenario.episode_steps
        worlds = config.scenario.replace(episode_steps=2 * onset, faults=())
        _, policy = load_trained(self.folder, worlds)
        done = 0

        def count(episodes: int) -> None:
            nonlocal done
            done += episodes
            report(min(1.0, done / (3 * self.episodes)))

        record, failures = play_failures(
            *(policy, worlds, onset, self.episodes, config.evaluate.seed),
            num_threads=config.train.threads,
            progress=count,
        )
        leads = handoff_leads(record)
        values: dict[str, float | None] = {"handoffs": float(len(leads["robot"]))}
        for when, steps in (("before", BEFORE), ("after", AFTER)):
            for who, name in (("robot", ""), ("bystander", "_bystander")):
                values[f"lead_{when}{name}"] = mean_lead(leads[who], OFFSETS, steps)
        if failures is not None:
            values |= {
                f"{RETAINED}_most_attended": failures.retained_most(),
                f"{RETAINED}_least_attended": failures.retained_least(),
                f"{RETAINED}_nearest": failures.retained_nearest(),
                f"{RETAINED}_helper": failures.retained_helper(),
                f"{RETAINED}_other": failures.retained_other(),
                "attends_nearest": failures.attends_nearest(),
                "attends_helper": failures.attends_helper(),
            }
        return {
            "episodes": self.episodes,
            "episode_steps": worlds.episode_steps,
            "onset_step": onset,
            "offsets": OFFSETS.tolist(),
            "leads": {who: _means(own) for who, own in leads.items()},
            self.values_key: {
                name: values.get(name.removeprefix(f"{ACTOR}_")) for name in ActorAttention.measures
            },
        }

    def checked(self, document: Any) -> dict[str, Any]:
        """A document of this measurement, with leads of all offsets."""
        float(document["values"][f"{ACTOR}_handoffs"])
        for who in ("robot", "bystander"):
            leads = _leads_in(document, who)
            if len(leads) != len(OFFSETS):
                raise ValueError(f"{len(leads)} offsets")
        return super().checked(document)

    @classmethod
    def of(cls, study: StudyFolder, run: PlannedRun) -> Self | None:
        """That of a run; None where the study does not ask for it, or its actors do not attend."""
        asked = study.study.actor_attention
        if asked is None or not asked.takes(run.config):
            return None
        path = cls.file(study, run, {"episodes": asked.episodes})
        return cls(run=run, folder=study.runs / run.key, path=path, episodes=asked.episodes)


def handoff_leads(record: Record) -> dict[str, NDArray[np.float64]]:
    """Leads of the next partner around the handoffs in whose window the bystander rescues nobody.

    Args:
        record: with the attention of actors.

    Returns:
        (N, W) by "robot", which hands over, and "bystander".
    """
    events = all_handoffs(record)
    others = with_control(record, events)
    idle = rescues_nobody(record, others)
    return {
        "robot": partner_leads(record, events[idle], OFFSETS, _FIELD),
        "bystander": partner_leads(record, others[idle], OFFSETS, _FIELD),
    }


def _means(leads: NDArray[np.float64]) -> list[float | None]:
    """Means over handoffs by offset; None where there is no step."""
    known = np.isfinite(leads)
    counts, sums = known.sum(0), np.where(known, leads, 0.0).sum(0)
    return [float(x / n) if n else None for x, n in zip(sums, counts, strict=True)]


def _leads_in(document: Mapping[str, Any], who: str) -> list[float]:
    """The leads in a document by offset; NaN where there is no step."""
    return [math.nan if one is None else float(one) for one in document["leads"][who]]


@dataclass(frozen=True)
class LeadCurves:
    """Leads of the next partner by offset, over the runs of one place in the grid.

    Attributes:
        offsets: (W,) int64 steps since the first rescue's.
        step_s: length of a step [s].
        robot: (W,) of the robot that hands over.
        bystander: (W,) of the other robot.
        handoffs: of all runs.
        runs: how many.
    """

    offsets: NDArray[np.int64]
    step_s: float
    robot: SeedCurve
    bystander: SeedCurve
    handoffs: int
    runs: int


def lead_curves(study: StudyFolder, runs: Iterable[PlannedRun]) -> LeadCurves | None:
    """The leads of some runs of a study; None where none of them has been measured.

    Raises:
        RunError: a file is damaged.
        OSError: a file cannot be read.
    """
    found = [(run, RunAttention.of(study, run)) for run in runs]
    documents = [
        (run, document)
        for run, one in found
        if one is not None and (document := one.document(study)) is not None
    ]
    if not documents:
        return None
    courses = {
        who: seed_curve(np.array([_leads_in(one, who) for _, one in documents], np.float64))
        for who in ("robot", "bystander")
    }
    handoffs = sum(int(one["values"][f"{ACTOR}_handoffs"]) for _, one in documents)
    step_s = documents[0][0].config.scenario.dt_s
    return LeadCurves(OFFSETS, step_s, **courses, handoffs=handoffs, runs=len(documents))
