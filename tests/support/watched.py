"""Records to replay: scripted motion, made attention."""

from dataclasses import replace

import numpy as np

from innerattn.config import Scenario
from innerattn.evaluate.play import run_episodes
from innerattn.policies import scripted_policy
from innerattn.records.record import FIELDS, Record


def watched(
    scenario: Scenario | None = None,
    *,
    script: str = "hungarian",
    episodes: int = 6,
    heads: int = 4,
    actor_heads: int = 0,
    seed: int = 5,
) -> Record:
    """Episodes of a script, recorded whole; with attention that is drawn if there are heads.

    Likewise with that of actors if these have heads.
    """
    scenario = scenario or Scenario.preset("mixed")
    policy = scripted_policy(script, scenario, seed)
    record = run_episodes(policy, scenario, episodes, seed, record=FIELDS)
    drawn = {"attention": (heads, seed), "actor_attention": (actor_heads, seed + 1)}
    steps = {name: _weights(record, *one) for name, one in drawn.items() if one[0]}
    return replace(record, steps={**record.steps, **steps})


def _weights(record: Record, heads: int, seed: int) -> np.ndarray:
    robots = record.scenario.num_robots
    shape = (record.num_episodes, record.scenario.episode_steps, heads, robots, robots)
    weights = np.random.default_rng(seed).gamma(0.7, size=shape) + 1e-6
    weights *= 1.0 - np.eye(robots)
    weights /= np.maximum(weights.sum(-1, keepdims=True), 1e-9)
    return weights.astype(np.float32)
