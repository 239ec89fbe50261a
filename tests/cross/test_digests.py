"""Worlds do what the kept digests say, with any number of threads and in any batch."""

import json

import pytest
from digests import (
    AUTORESET,
    FILE,
    NUM_ENVS,
    SEED,
    STEPS,
    actions,
    digest,
    scenarios,
    shown,
)

from innerattn.config import Scenario
from innerattn.envs import BatchEnv

KEPT = json.loads(FILE.read_text("utf-8"))
ROWS = {row["name"]: row for row in KEPT["rows"]}
THREADS = (1, 2, 3, 8, 16)


def test_the_kept_scenarios_are_those_of_the_source() -> None:
    assert (KEPT["num_envs"], KEPT["steps"], KEPT["seed"]) == (NUM_ENVS, STEPS, SEED)
    kept = {name: Scenario.model_validate(row["scenario"]) for name, row in ROWS.items()}
    assert scenarios() == kept
    assert len({row["sha256"] for row in KEPT["rows"]}) == len(ROWS) == 14


@pytest.mark.long
@pytest.mark.parametrize("name", ROWS)
def test_worlds_do_what_they_did(name: str) -> None:
    row = ROWS[name]
    scenario = Scenario.model_validate(row["scenario"])
    kept = {key: row[key] for key in ("sha256", "crc32")}
    for threads in THREADS:
        assert digest(shown(scenario, threads)) == kept, threads
    larger = shown(scenario, 2, NUM_ENVS + 5)
    assert digest(worlds[:NUM_ENVS] for worlds in larger) == kept
    alone = [shown(scenario, 1, 1, first_env) for first_env in range(NUM_ENVS)]
    assert digest([one[0] for one in worlds] for worlds in zip(*alone, strict=True)) == kept


def test_they_have_every_situation_and_the_keys_that_the_reliability_page_names() -> None:
    every = scenarios().values()
    assert {one.situation for one in every} == {"single", "double", "mixed", "poisson", "listed"}
    assert {one.engine for one in every} == {"rapier", "discs"}
    tasks = [task for one in every for task in one.tasks]
    assert {task.service for task in tasks if task.service_s} == {"keep", "restart"}
    for key in ("deadline_s", "area_m", "after", "arrival_rate_hz"):
        assert any(getattr(task, key) for task in tasks), key
    for key in ("observed_teammates", "observed_victims", "end_when_done", "faults", "obstacles"):
        assert any(getattr(one, key) for one in every), key


@pytest.mark.parametrize(
    "name", ["poisson, deadlines", "listed, services", "services, areas of tasks, discs"]
)
def test_what_they_are_to_show_happens_in_them(name: str) -> None:
    """A digest of worlds in which nobody is served or lost would tell nothing of it."""
    scenario = scenarios()[name]
    served = lost = rescued = 0
    with BatchEnv(scenario, NUM_ENVS, SEED, 1, autoreset=AUTORESET) as env:
        env.reset()
        for step in range(STEPS):
            rescued += len(env.step(actions(step, NUM_ENVS, env.num_robots)).rescues)
            lost += len(env.lost())
            if scenario.has_services:
                victims = env.victims()
                served += int(((victims["served"] > 0.0) & victims["present"]).sum())
    assert rescued >= 10
    assert lost >= 50
    assert served >= 30 * scenario.has_services
