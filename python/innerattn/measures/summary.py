"""From records to the summary of an evaluation; it runs nothing and prints nothing."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from innerattn.measures.attention import Entropy, entropy_of
from innerattn.measures.cooperation import count_cooperation, count_pairs, pair_rates
from innerattn.measures.measure import Value
from innerattn.measures.registry import measures_of
from innerattn.policies import best_script, scripts_of
from innerattn.records.record import Record
from innerattn.stats import Estimate
from innerattn.stats.bootstrap import mean_interval, score_interval
from innerattn.stats.estimate import as_json

SCHEMA_VERSION = 1


@dataclass(frozen=True)
class Performance:
    """What is measured at one length of episodes.

    Attributes:
        episodes: how many episodes the means are over.
        episode_steps: their length [control steps].
        rescues_per_episode: of the policy.
        score: 0 is random play, 1 the best script; None where that is not surely better.
        scripted: rescues per episode of the scripted policies, by name, in the same worlds.
        measures: of the policy and of the scripted ones, by policy and by the names of `MEASURES`.
    """

    episodes: int
    episode_steps: int
    rescues_per_episode: Estimate
    score: Estimate | None
    scripted: dict[str, Estimate]
    measures: dict[str, dict[str, Value]] = field(default_factory=dict)

    def script_score(self, name: str) -> float | None:
        """The score of a scripted policy; None where the policy has none."""
        return None if self.score is None else script_score(self.scripted, name)


def script_score(scripted: Mapping[str, Estimate], name: str) -> float:
    """The score of a scripted policy, from rescues per episode of all of them by name."""
    least, most = scripted["random"].mean, scripted[best_script(scripted)].mean
    return (scripted[name].mean - least) / (most - least)


@dataclass(frozen=True)
class Summary:
    """The results of one evaluation.

    Attributes:
        policy: name of the run or of the scripted policy.
        method: the method of training, or the scripted policy.
        situation: of the worlds.
        seed: of the worlds.
        episodes: how many episodes cooperation and attention were recorded in.
        standard: results at the scenario's own length.
        long: results at the second length.
        cooperation: rescues by task and robot, where there was a choice of robots.
        cooperation_rates: eq. 10 by robot i and teammate j, for i that ever helped with another.
        attention_entropy: by robot and head [nats]; empty where there is no attention.
        attention_entropy_share: the same as a share of ln(R - 1); None below three robots.
        warm_start: the scripted policy that training began by imitating, or "none".
    """

    policy: str
    method: str
    situation: str
    seed: int
    episodes: int
    standard: Performance
    long: Performance
    cooperation: dict[str, dict[str, int]]
    cooperation_rates: dict[str, dict[str, float]]
    attention_entropy: dict[str, list[float]]
    attention_entropy_share: dict[str, list[float | None]]
    warm_start: str = "none"

    def to_json(self) -> dict[str, Any]:
        """The document that `evaluate --json` and a run folder's summary.json hold."""
        standard = as_json(self.standard)
        return {
            "schema_version": SCHEMA_VERSION,
            "policy": self.policy,
            "method": self.method,
            "warm_start": self.warm_start,
            "situation": self.situation,
            "episodes": self.episodes,
            "episode_steps": standard["episode_steps"],
            "seed": self.seed,
            "score_episodes": standard["episodes"],
            "rescues_per_episode": standard["rescues_per_episode"],
            "score": standard["score"],
            "scripted": standard["scripted"],
            "measures": standard["measures"],
            "long": as_json(self.long),
            "cooperation": self.cooperation,
            "cooperation_rates": self.cooperation_rates,
            "attention_entropy": self.attention_entropy,
            "attention_entropy_share": self.attention_entropy_share,
        }


def summarise(
    policy: str,
    recorded: Record,
    standard: Mapping[str, Sequence[Record]],
    long: Mapping[str, Sequence[Record]],
    warm_start: str = "none",
) -> Summary:
    """The summary of one policy's evaluation.

    Args:
        policy: name of the run or of the scripted policy.
        recorded: the episodes that cooperation and attention are taken from.
        standard: by policy name, records of the standard length; holds ``recorded.policy`` and the
            scripted policies, all over the same worlds.
        long: the same for the second length.
        warm_start: the scripted policy that training began by imitating, or "none".
    """
    scenario, names = recorded.scenario, recorded.robot_names
    entropy = entropy_of(recorded)
    return Summary(
        policy=policy,
        method=recorded.policy,
        situation=scenario.situation,
        seed=recorded.seed,
        episodes=recorded.num_episodes,
        standard=_performance(recorded.policy, standard, recorded.seed),
        long=_performance(recorded.policy, long, recorded.seed),
        cooperation=count_cooperation(recorded.rescues, scenario),
        cooperation_rates=_rates(recorded),
        attention_entropy=_rows(names, entropy),
        attention_entropy_share=_shares(names, entropy),
        warm_start=warm_start,
    )


def _performance(method: str, records: Mapping[str, Sequence[Record]], seed: int) -> Performance:
    counts = {
        name: np.concatenate([part.rescue_counts() for part in parts])
        for name, parts in records.items()
    }
    means = {name: mean_interval(values, seed) for name, values in counts.items()}
    scenario = records[method][0].scenario
    scripted = {name: means[name] for name in scripts_of(scenario)}
    return Performance(
        episodes=len(counts[method]),
        episode_steps=scenario.episode_steps,
        rescues_per_episode=means[method],
        score=score_interval(counts[method], counts["random"], counts[best_script(scripted)], seed),
        scripted=scripted,
        measures={name: measures_of(*parts) for name, parts in records.items()},
    )


def _rates(recorded: Record) -> dict[str, dict[str, float]]:
    names = recorded.robot_names
    rates = pair_rates(count_pairs(recorded.rescues, len(names)))
    return {
        names[i]: {names[j]: float(rate) for j, rate in enumerate(row) if j != i}
        for i, row in enumerate(rates)
        if not np.isnan(row).any()
    }


def _rows(names: Sequence[str], entropy: Entropy | None) -> dict[str, list[float]]:
    return {} if entropy is None else dict(zip(names, entropy.nats.tolist(), strict=True))


def _shares(names: Sequence[str], entropy: Entropy | None) -> dict[str, list[float | None]]:
    if entropy is None:
        return {}
    return {name: _or_none(row) for name, row in zip(names, entropy.share, strict=True)}


def _or_none(row: NDArray[np.float64]) -> list[float | None]:
    return [None if math.isnan(value) else value for value in row.tolist()]
