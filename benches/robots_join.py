"""What a policy for any team rescues while robots of its team leave and others join.

`python benches/robots_join.py zoo:any my_team.toml out:digger_1 in:digger_2` plays worlds without
an end. After every 20 seconds a robot leaves or joins, in the order given; spare robots of each
kind wait outside. The table stands in `docs/teams.md`.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from page import machine, publish, table

from innerattn.config import Scenario
from innerattn.envs import BatchEnv
from innerattn.evaluate import load_trained
from innerattn.evaluate.interactive import endless
from innerattn.evaluate.spares import USUAL_SPARES, with_spares
from innerattn.policies import PolicyInput
from innerattn.stats.student import student_interval

PAGE = Path(__file__).parents[1] / "docs" / "teams.md"
SECONDS, SEED = 20.0, 12_345
JOINS = {"in": True, "out": False}


def main() -> None:
    """Measures and publishes."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("run")
    parser.add_argument("scenario", type=Path)
    parser.add_argument("changes", nargs="+", help="out:ROBOT or in:ROBOT")
    parser.add_argument("--worlds", type=int, default=8)
    given = parser.parse_args()
    own = Scenario.from_toml(given.scenario)
    worlds = endless(with_spares(own, USUAL_SPARES))
    names = [robot.name for robot in worlds.robots]
    policy = load_trained(given.run, worlds, each_sees=True)[1]
    policy.reset(0)
    steps = round(SECONDS / worlds.dt_s)
    rows = []
    with BatchEnv(worlds, given.worlds, SEED, num_threads=1) as env:
        obs = env.reset()
        there = np.zeros((given.worlds, len(names)), np.bool_)
        there[:, : own.num_robots] = True
        for change in ["", *given.changes]:
            told = "none: the team of the file"
            if change:
                way, robot = change.split(":")
                there[:, names.index(robot)] = JOINS[way]
                env.set_present(there)
                obs = env.observe()
                told = f"`{robot}` {'joins' if JOINS[way] else 'leaves'}"
            rescues = np.zeros((given.worlds, len(worlds.tasks)))
            for _ in range(steps):
                step = env.step(policy.act(PolicyInput(obs)))
                obs = step.obs
                np.add.at(rescues, (step.rescues["env"], step.rescues["task"]), 1)
            whole = student_interval(rescues.sum(1))
            every = f"{whole.mean:.1f} ± {(whole.high - whole.low) / 2:.1f}"
            rows.append([told, *(f"{one:.1f}" for one in rescues.mean(0)), every])
            print(*rows[-1], flush=True)
    head = ["change", *(f"`{task.name}`" for task in worlds.tasks), "all"]
    told = f"{machine()}. Means over {given.worlds} worlds, seed {SEED}, with 95 % intervals."
    publish("robots_join", f"{table(head, rows)}\n\n{told}", PAGE)


if __name__ == "__main__":
    main()
