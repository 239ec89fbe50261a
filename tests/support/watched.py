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
    seed: int = 5,
) -> Record:
    """Episodes of a script, recorded whole; with attention that is drawn if there are heads."""
    scenario = scenario or Scenario.preset("mixed")
    policy = scripted_policy(script, scenario, seed)
    record = run_episodes(policy, scenario, episodes, seed, record=FIELDS)
    if not heads:
        return record
    shape = (episodes, scenario.episode_steps, heads, scenario.num_robots, scenario.num_robots)
    weights = np.random.default_rng(seed).gamma(0.7, size=shape) + 1e-6
    weights *= 1.0 - np.eye(scenario.num_robots)
    weights /= np.maximum(weights.sum(-1, keepdims=True), 1e-9)
    return replace(record, steps={**record.steps, "attention": weights.astype(np.float32)})
