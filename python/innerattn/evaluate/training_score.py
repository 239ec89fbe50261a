"""The score of a team while it trains, from its training episodes and a few of the scripts'."""

from __future__ import annotations

from dataclasses import dataclass

from innerattn.config import RunConfig
from innerattn.evaluate.play import run_episodes
from innerattn.policies import best_script, scripted_policy, scripts_of

_EPISODES = 100


@dataclass(frozen=True)
class ScriptedRescues:
    """Rescues per training episode of the scripts that a score is between."""

    random: float
    best: float

    def score(self, rescues: float) -> float | None:
        """0 as `random`, 1 as the best script; None where that is not the better one."""
        span = self.best - self.random
        return (rescues - self.random) / span if span > 0.0 else None


def scripted_rescues(config: RunConfig, episodes: int = _EPISODES) -> ScriptedRescues:
    """Play both scripts in episodes as long as those of a run's training.

    With 100 episodes the standard error of a score of 1 is 0.02 to 0.03 in the built-in scenarios.
    """
    threads = config.train.threads
    best = best_script(scripts_of(config.training_scenario))
    return ScriptedRescues(
        random=training_rescues(config, "random", episodes, threads),
        best=training_rescues(config, best, episodes, threads),
    )


def training_rescues(config: RunConfig, script: str, episodes: int, threads: int | None) -> float:
    """Mean rescues of a script in episodes as long as those of a run's training, in such worlds.

    Where reaching a goal ends an episode, all are counted over its longest length, as
    `innerattn.records.logged.logged_rescues` does.

    Args:
        config: the run.
        script: name of a scripted policy.
        episodes: how many are played.
        threads: that step the worlds, which changes no number; None: all cores.
    """
    scenario, seed = config.training_scenario, config.train.seed
    policy = scripted_policy(script, scenario, seed)
    record = run_episodes(policy, scenario, episodes, seed, num_threads=threads, purpose="training")
    if not scenario.ends_early:
        return len(record.rescues) / episodes
    return len(record.rescues) / float(record.lengths.sum()) * scenario.episode_steps
