"""Compiled updates beside those of an older version, in turn, by team size, method and encoder.

`python benches/older_updates.py FOLDER` fills its place in `docs/performance.md`. FOLDER is
`python` of a checkout of the older version, with its compiled module. Random rows of the sizes of
mixed worlds, one thread, networks of `fast`.
"""

from __future__ import annotations

import statistics
import sys
import time
from collections.abc import Callable
from typing import NamedTuple

from versions import older_and_now

ROWS = 512
ROUNDS = 40


class Case(NamedTuple):
    """What is updated."""

    preset: str
    method: str
    encoder: str
    pooling: str


CASES = [
    Case("mixed", "mappo", "flat", "attention"),
    Case("mixed", "ppo-inner", "flat", "attention"),
    Case("mixed", "ppo-uniform", "entities", "mean"),
    Case("mixed", "ppo-uniform", "entities", "attention"),
    Case("mixed-16", "ppo-inner", "flat", "attention"),
    Case("mixed-16", "ppo-uniform", "entities", "mean"),
    Case("mixed-16", "ppo-uniform", "entities", "attention"),
]


def update_of(case: Case) -> tuple[Callable[[], object], int]:
    """An update of random rows, and how often a training passes over its rows."""
    import torch

    from innerattn.config import load_run_config
    from innerattn.envs import BatchEnv
    from innerattn.learn.ppo import PPO
    from innerattn.learn.rollout import Rollout
    from innerattn.train.build import build_learner

    network = {"network.encoder": case.encoder, "network.pooling": case.pooling}
    given = network | {"network.symmetry": "none"}
    config = load_run_config(case.preset, case.method, "fast", overrides=given)
    with BatchEnv(config.scenario, 1) as env:
        learner = build_learner(config, env, training=True)
        robots, width, actions = env.num_robots, env.obs_width, env.num_actions
    assert isinstance(learner, PPO)
    learner.compile()
    source = torch.Generator().manual_seed(0)
    numbers = [torch.randn(robots, ROWS, generator=source) for _ in range(2)]
    rows = Rollout(
        torch.randn(ROWS, robots, width, generator=source).transpose(0, 1),
        torch.randint(actions, (robots, ROWS), generator=source),
        torch.full((robots, ROWS), -1.6),
        *numbers,
    )
    return lambda: learner.update(rows), config.algorithm.epochs


def measure() -> None:
    """In a process of one version: answer each number of a case by passes and milliseconds."""
    import torch

    from innerattn.train.build import keep_heap_small

    torch.set_num_threads(1)
    keep_heap_small()  # as a training does
    updates: dict[int, tuple[Callable[[], object], int]] = {}
    for line in sys.stdin:
        number = int(line)
        if number not in updates:
            updates[number] = update_of(CASES[number])
            updates[number][0]()
        update, passes = updates[number]
        start = time.perf_counter()
        update()
        print(passes, 1e3 * (time.perf_counter() - start), flush=True)


def main() -> None:
    """Measure and publish."""
    if sys.argv[1:] == ["--measure"]:
        measure()
        return
    from page import machine, publish, table

    versions, rows = older_and_now(__file__), []
    for number, case in enumerate(CASES):
        taken: list[list[float]] = []
        for _ in range(ROUNDS + 1):
            answers = [version.ask(number).split() for version in versions]
            taken.append([float(answer[1]) for answer in answers])
        passes = int(answers[0][0])
        older, now = (statistics.median(column) for column in zip(*taken[1:], strict=True))
        ratio = statistics.median(old / new for old, new in taken[1:])
        encoder = case.encoder if case.encoder == "flat" else f"{case.encoder}, {case.pooling}"
        cells = [case.preset, case.method, encoder, f"{older:.1f}", f"{now:.1f}", f"{ratio:.2f}"]
        rows.append([*cells, f"{ROWS / passes / now * 1e3:,.0f}"])
    head = ["worlds", "method", "encoder", "before, ms", "now, ms", "times as fast", "env-steps/s"]
    publish("older_updates", f"{machine('torch')}.\n\n{table(head, rows)}")


if __name__ == "__main__":
    main()
