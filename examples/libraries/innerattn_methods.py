"""innerattn's own methods, trained from Python with the budget `fast`.

`fast` is made for 250,000 env-steps. Its worlds and epochs of PPO are changed to those of
`sb3_ppo.py`, and updates are not compiled, since compiling takes longer than so short a training.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import torch
from numpy.typing import NDArray
from scoring import Stopwatch, options, report

from innerattn.config import load_run_config
from innerattn.train import load_policy, train

METHODS = {
    "ppo-inner": {"train.num_envs": 64, "ppo.epochs": 4},
    "mappo": {"train.num_envs": 64, "ppo.epochs": 4},
    "td-inner": {},
}
"""What each method changes in `fast`."""


def main() -> None:
    """Train for a number of env-steps and score the team."""
    methods = {"choices": list(METHODS), "default": "ppo-inner"}
    given = options(__doc__, 250_000, method=methods)
    overrides = METHODS[given.method] | {
        "train.env_steps": given.env_steps,
        "train.seed": given.seed,
        "train.compile": "off",
    }
    config = load_run_config(given.situation, given.method, "fast", overrides=overrides)
    with tempfile.TemporaryDirectory() as runs:
        folder = Path(runs) / "run"
        watch = Stopwatch()
        train(config, folder)
        spent = watch.stop()
        _, learner = load_policy(folder)

    def actor(obs: NDArray) -> NDArray:
        return learner.act(torch.from_numpy(obs), greedy=True).numpy()

    report("innerattn", given.method, given, given.env_steps, spent, actor)


if __name__ == "__main__":
    main()
