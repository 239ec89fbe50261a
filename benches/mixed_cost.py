"""What it costs to step worlds of several teams as one batch, beside the same worlds in one.

`python benches/mixed_cost.py` steps 1,024 worlds on one thread by random actions drawn beforehand,
in turn: all of one team, the same team in 16 batches, and 16 unlike teams of a family, and fills
its place in `docs/performance.md`.
"""

from __future__ import annotations

import statistics
from collections.abc import Callable
from itertools import cycle

import numpy as np
from in_turns import rates
from page import machine, publish, table

from innerattn.config import Family, Scenario
from innerattn.envs import BatchEnv, MixedBatchEnv

TEAMS, WORLDS = 16, 64
Act = Callable[[], object]


def of_one_team(scenario: Scenario) -> dict[str, Act]:
    """A step of all worlds as one batch, and as several of the same team."""
    batch = BatchEnv(scenario, TEAMS * WORLDS, num_threads=1)
    mixed = MixedBatchEnv.of([scenario] * TEAMS, WORLDS, num_threads=1)
    drawn = np.random.default_rng(0).integers(0, 5, (16, TEAMS * WORLDS, scenario.num_robots))
    rows, flat = cycle(drawn), cycle(drawn.reshape(16, -1))
    batch.reset()
    mixed.reset()
    return {
        "one batch": lambda: batch.step(next(rows)),
        "one batch, entities": lambda: batch.entities(batch.step(next(rows)).obs),
        f"{TEAMS} batches": lambda: mixed.step_batches(next(flat)),
        f"{TEAMS} batches, entities": lambda: mixed.step(next(flat)),
    }


def of_unlike_teams(base: Scenario) -> dict[str, Act]:
    """A step of unlike teams one after the other, and as one batch."""
    family = Family()
    teams = [family.draw(0, number, base) for number in range(TEAMS)]
    alone = [
        BatchEnv(team, WORLDS, num_threads=1, first_env=WORLDS * number)
        for number, team in enumerate(teams)
    ]
    mixed = MixedBatchEnv.of(teams, WORLDS, num_threads=1)
    rng = np.random.default_rng(0)
    flat = cycle(rng.integers(0, 5, (16, mixed.num_robots)))
    rows = [cycle(rng.integers(0, 5, (16, WORLDS, one.num_robots))) for one in alone]
    for one in (*alone, mixed):
        one.reset()

    def step_each() -> None:
        for one, actions in zip(alone, rows, strict=True):
            one.step(next(actions))

    return {
        f"{TEAMS} unlike teams, one after the other": step_each,
        f"{TEAMS} unlike teams": lambda: mixed.step_batches(next(flat)),
        f"{TEAMS} unlike teams, entities": lambda: mixed.step(next(flat)),
    }


def main() -> None:
    """Measure and publish."""
    head = ["env-steps/s", *(cell for engine in ("rapier", "discs") for cell in (engine, "share"))]
    rows: dict[str, list[str]] = {}
    for engine in ("rapier", "discs"):
        scenario = Scenario.preset("mixed").replace(engine=engine)
        for acts in (of_one_team(scenario), of_unlike_teams(Scenario().replace(engine=engine))):
            found = rates(acts, TEAMS * WORLDS)
            base = next(iter(found.values()))
            for name, speeds in found.items():
                share = statistics.median(a / b for a, b in zip(speeds, base, strict=True))
                row = rows.setdefault(name, [name])
                row += [f"{statistics.median(speeds):,.0f}", f"{share:.3f}"]
    publish("mixed_cost", f"{machine('numpy')}.\n\n{table(head, list(rows.values()))}")


if __name__ == "__main__":
    main()
