"""The worlds of pages without a browser: Node.js runs them, and they are Python's."""

import json
from importlib.resources import files
from typing import Any

import numpy as np
import pytest
from in_node import run_in_node
from numpy.typing import NDArray
from sensing import sensing

from innerattn.config import Scenario
from innerattn.config.streams import stream_seed
from innerattn.envs import BatchEnv
from innerattn.report.page.page import WORLDS

FOLDER = files("innerattn.report.page")
STEPS, SEED = 10_000, 12_345

# Plays worlds with the actions that it is told; writes the bytes of all observations.
PLAY = """
const { readFileSync } = require("node:fs");
const [glue, code] = process.argv.slice(1).map((file) => readFileSync(file));
const { scenario, seed, actions } = JSON.parse(readFileSync(0, "utf8"));
const { Rust } = new Function(`class Refusal extends Error {}\\n${glue}\\nreturn { Rust };`)();
Rust.load(code).then((rust) => {
  const world = rust.open(scenario, BigInt(seed)), parts = [];
  const look = () => parts.push(Buffer.from(Float32Array.from(world.take("observations")).buffer));
  world.restart();
  look();
  for (const one of actions) {
    world.step(one.flat());
    look();
  }
  world.close();
  process.stdout.write(Buffer.concat(parts));
});
"""


def worlds(name: str) -> Scenario:
    """Worlds of some sort."""
    made = {
        "sensing": sensing,
        "continuous": lambda: Scenario.preset("mixed-faults").replace(actions="continuous"),
    }
    return made[name]() if name in made else Scenario.preset(name)


def drawn_actions(scenario: Scenario) -> NDArray[Any]:
    """Random actions (T, 1, R) or (T, 1, R, 2)."""
    draws = np.random.default_rng(5)
    if scenario.actions == "continuous":
        return draws.uniform(-1, 1, (STEPS, 1, scenario.num_robots, 2)).astype(np.float32)
    return draws.integers(0, 5, (STEPS, 1, scenario.num_robots))


@pytest.mark.parametrize("name", ["mixed", "air-ground", "continuous", "sensing"])
def test_they_give_the_same_observations_to_the_bit(name: str) -> None:
    scenario, seed = worlds(name), stream_seed(SEED, "evaluation")
    actions = drawn_actions(scenario)
    told = {
        "scenario": scenario.model_dump_json(),
        "seed": str(seed),
        "actions": actions[:, 0].tolist(),
    }
    scripts = FOLDER / "web" / "rust.js", FOLDER / WORLDS
    written = run_in_node(PLAY, *scripts, told=json.dumps(told), seconds=200)
    with BatchEnv(scenario, 1, seed, num_threads=1) as env:
        here = np.stack([env.reset(), *(env.step(one).obs for one in actions)])
        assert env.episodes()[0] == STEPS // scenario.episode_steps
    there = np.frombuffer(written, "<f4").reshape(here.shape)
    different = np.flatnonzero((there.view(np.uint32) != here.view(np.uint32)).any(axis=(1, 2, 3)))
    assert not len(different), f"first at step {different[0]}"
