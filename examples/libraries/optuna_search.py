"""Optuna searches three numbers of innerattn's own PPO: learning rate, entropy weight, discount.

Each trial trains a run with a part of the env-steps. The team with the best score is reported. With
few env-steps all trials score alike: in canonical frames a team first learns to drive straight at
its first victim, whatever the numbers are.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import optuna
import torch
from numpy.typing import NDArray
from scoring import Actor, Stopwatch, options, report, rescues

from innerattn.config import Scenario, load_run_config
from innerattn.train import load_policy, train


def main() -> None:
    """Search, then score the best team."""
    given = options(__doc__, 200_000, trials={"type": int, "default": 4, "help": "of the search"})
    scenario = Scenario.preset(given.situation)
    teams: dict[int, Actor] = {}

    def objective(trial: optuna.Trial) -> float:
        entropy = trial.suggest_float("entropy_weight", 1e-3, 3e-2, log=True)
        config = load_run_config(given.situation, "ppo-inner", "fast")
        # The budget's schedule sets the weight of entropy, so the search changes the schedule.
        schedule = config.train.schedule.model_dump(exclude_none=True)
        schedule["entropy_weight"] |= {"first": entropy, "last": entropy / 50}
        overrides = {
            "train.schedule": schedule,
            "ppo.learning_rate": trial.suggest_float("learning_rate", 5e-4, 1e-2, log=True),
            "ppo.gamma": trial.suggest_float("gamma", 0.9, 0.99),
            "train.num_envs": 64,  # fewer worlds: more updates in so few steps
            "train.compile": "off",
            "train.env_steps": given.env_steps // given.trials,
            "train.seed": given.seed,
        }
        config = load_run_config(given.situation, "ppo-inner", "fast", overrides=overrides)
        folder = Path(runs) / str(trial.number)
        train(config, folder)
        _, learner = load_policy(folder)

        def actor(obs: NDArray) -> NDArray:
            return learner.act(torch.from_numpy(obs), greedy=True).numpy()

        teams[trial.number] = actor
        return rescues(scenario, actor)

    sampler = optuna.samplers.TPESampler(seed=given.seed)
    study = optuna.create_study(direction="maximize", sampler=sampler)
    watch = Stopwatch()
    with tempfile.TemporaryDirectory() as runs:
        study.optimize(objective, n_trials=given.trials)
    spent = watch.stop()
    print(f"best: {study.best_params}")
    report(
        "optuna",
        "search over ppo-inner",
        given,
        given.env_steps,
        spent,
        teams[study.best_trial.number],
    )


if __name__ == "__main__":
    main()
