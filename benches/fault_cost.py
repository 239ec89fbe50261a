"""What faults cost: env-steps a second with and without them, in turn, in one run.

`python benches/fault_cost.py` fills its place in `docs/performance.md`. 1,024 mixed worlds, random
discrete actions, all cores, Python call included.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Mapping
from contextlib import ExitStack

import numpy as np
from page import machine, publish, table

from innerattn.config import Fault, Scenario
from innerattn.envs import BatchEnv
from innerattn.envs.batch import FAULT_KINDS

ENGINES = ("rapier", "discs")
ENVS = 1024
ROUNDS = 41
ROUND_STEPS = {"rapier": 60, "discs": 300}
MIXED = Scenario.preset("mixed")


def faults(values: dict[str, float], onset_step: int = 0) -> tuple[Fault, ...]:
    """Faults of these kinds and values for every robot."""
    return tuple(
        Fault(robot=robot.name, kind=kind, value=value, onset_step=onset_step)
        for robot in MIXED.robots
        for kind, value in values.items()
    )


HEALTHY = {kind: float(kind in ("motor_gain", "speed_limit")) for kind in FAULT_KINDS}
CASES = {
    "none configured": (),
    "all kinds configured, all healthy": faults(HEALTHY),
    "half force from step 24 of 25": faults({"motor_gain": 0.5}, onset_step=24),
    "random onsets (mixed-faults)": Scenario.preset("mixed-faults").faults,
    "every robot at half force": faults({"motor_gain": 0.5}),
    "every robot, every kind at work": faults(
        dict.fromkeys(FAULT_KINDS, 0.5) | {"unavailable": 0.1}
    ),
}


def rates(engine: str, worlds: Mapping[str, Scenario]) -> dict[str, list[float]]:
    """Env-steps a second of each scenario, one number a round; they take turns in every round."""
    found: dict[str, list[float]] = {name: [] for name in worlds}
    with ExitStack() as stack:
        envs = {
            name: stack.enter_context(
                BatchEnv(scenario.replace(engine=engine), ENVS, seed=0, copy=False)
            )
            for name, scenario in worlds.items()
        }
        steps = ROUND_STEPS[engine]
        actions = np.random.default_rng(0).integers(0, 5, (16, ENVS, 4))
        for env in envs.values():
            env.reset()
        for round_index in range(ROUNDS + 1):
            for name, env in envs.items():
                start = time.perf_counter()
                for step in range(steps):
                    env.step(actions[step % 16])
                if round_index:
                    found[name].append(steps * ENVS / (time.perf_counter() - start))
    return found


def shares(worlds: Mapping[str, Scenario]) -> str:
    """A table of rates with both engines, and their shares of the rate of the first scenario."""
    head = ["env-steps/s", *(f"{engine}{part}" for engine in ENGINES for part in ("", ", share"))]
    columns = {engine: rates(engine, worlds) for engine in ENGINES}
    plain = next(iter(worlds))
    rows = []
    for name in worlds:
        row = [name]
        for found in columns.values():
            pairs = zip(found[name], found[plain], strict=True)
            share = statistics.median(one / without for one, without in pairs)
            row += [f"{statistics.median(found[name]):,.0f}", f"{share:.3f}"]
        rows.append(row)
    return table(head, rows)


def main() -> None:
    """Measure and publish."""
    worlds = {name: MIXED.replace(faults=chosen) for name, chosen in CASES.items()}
    publish("fault_cost", f"{machine('numpy')}.\n\n{shares(worlds)}")


if __name__ == "__main__":
    main()
