"""What the views of the worlds cost beside `BatchEnv`, and TorchRL's view beside that of VMAS.

`python benches/view_cost.py` steps 1,024 mixed worlds, or VMAS's simple spread with four agents, by
random actions drawn beforehand, in turn, and fills its place in `docs/performance.md`. TorchRL and
VMAS are left out where they are not installed.
"""

from __future__ import annotations

import statistics
from collections.abc import Callable
from importlib.util import find_spec
from itertools import cycle
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode
from in_turns import rates
from page import machine, publish, table

from innerattn.config import Scenario
from innerattn.envs import BatchEnv, RescueVectorEnv

NUM_ENVS = 1_024
Step = Callable[[], Any]


def of_numpy(scenario: Scenario) -> dict[str, Step]:
    """A step of the batch, and of Gymnasium's view with each mode and with copies."""
    actions = cycle(np.random.default_rng(0).integers(0, 5, (16, NUM_ENVS, scenario.num_robots)))
    steps: dict[str, Step] = {}
    for copy in (False, True):
        batch = BatchEnv(scenario, NUM_ENVS, copy=copy)
        batch.reset()
        steps[f"BatchEnv, copy={copy}"] = lambda batch=batch: batch.step(next(actions))
        for mode in (AutoresetMode.SAME_STEP, AutoresetMode.NEXT_STEP):
            view = RescueVectorEnv(NUM_ENVS, scenario, autoreset_mode=mode, copy=copy)
            view.reset()
            name = f"RescueVectorEnv, {mode.value}, copy={copy}"
            steps[name] = lambda view=view: view.step(next(actions))
    return steps


def of_torchrl(env: Any) -> Step:
    """A step of an environment of TorchRL, with the reset of ended worlds."""
    drawn = cycle([env.full_action_spec.rand() for _ in range(16)])
    now = [env.reset()]

    def step() -> None:
        _, now[0] = env.step_and_maybe_reset(now[0].update(next(drawn)))

    return step


def contestants(engine: str) -> dict[str, Step]:
    """What is measured with an engine."""
    scenario = Scenario.preset("mixed").replace(engine=engine)
    steps = of_numpy(scenario)
    if find_spec("torchrl"):
        from innerattn.envs import RescueTorchRLEnv

        steps["RescueTorchRLEnv"] = of_torchrl(RescueTorchRLEnv(scenario, NUM_ENVS))
        if find_spec("vmas"):
            from torchrl.envs.libs.vmas import VmasEnv

            peer = VmasEnv("simple_spread", num_envs=NUM_ENVS, max_steps=25, n_agents=4)
            steps["VmasEnv (its simple spread)"] = of_torchrl(peer)
    return steps


def main() -> None:
    """Measure and publish."""
    head = ["env-steps/s", *(cell for engine in ("rapier", "discs") for cell in (engine, "share"))]
    rows: dict[str, list[str]] = {}
    for engine in ("rapier", "discs"):
        found = rates(contestants(engine), NUM_ENVS)
        base = found["BatchEnv, copy=False"]
        for name, speeds in found.items():
            share = statistics.median(a / b for a, b in zip(speeds, base, strict=True))
            row = rows.setdefault(name, [name])
            row += [f"{statistics.median(speeds):,.0f}", f"{share:.3f}"]
    packages = [name for name in ("numpy", "gymnasium", "torchrl", "vmas") if find_spec(name)]
    publish("view_cost", f"{machine(*packages)}.\n\n{table(head, list(rows.values()))}")


if __name__ == "__main__":
    main()
