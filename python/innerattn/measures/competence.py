"""How well a policy dispatches: which robot goes, and how long victims wait."""

from __future__ import annotations

from innerattn.measures.dispatch_quality import dispatch_quality
from innerattn.measures.waiting import waiting
from innerattn.records.record import Record
from innerattn.stats.intervals import Interval

STEPS = ("positions", "velocities", "victims")
"""What must be recorded step by step."""


def competence_of(record: Record) -> dict[str, float | int | None]:
    """Counts and values by name, see `DispatchQuality` and `Waiting`.

    Raises:
        ValueError: one of `STEPS` was not recorded.
    """
    choice, waited = dispatch_quality(record), waiting(record)
    return {
        "episodes": record.num_episodes,
        "choices": choice.choices,
        "rescued": waited.rescued,
        "left": waited.left,
        "sooner": _mean(choice.sooner),
        "sooner_by_chance": choice.sooner_by_chance,
        "regret_s": _mean(choice.regret_s),
        "regret_by_chance_s": choice.regret_by_chance_s,
        "time_to_rescue_s": _mean(waited.time_to_rescue_s),
        "time_per_rescue_s": _mean(waited.time_per_rescue_s),
    }


def _mean(interval: Interval | None) -> float | None:
    return None if interval is None else interval.mean
