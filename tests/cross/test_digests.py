"""Worlds do what the kept digests say, with any number of threads and in any batch."""

import json

import pytest
from digests import FILE, NUM_ENVS, SEED, STEPS, digest, scenarios, shown

from innerattn.config import Scenario

KEPT = json.loads(FILE.read_text("utf-8"))
ROWS = {row["name"]: row for row in KEPT["rows"]}
THREADS = (1, 2, 3, 8, 16)


def test_the_kept_scenarios_are_those_of_the_source() -> None:
    assert (KEPT["num_envs"], KEPT["steps"], KEPT["seed"]) == (NUM_ENVS, STEPS, SEED)
    kept = {name: Scenario.model_validate(row["scenario"]) for name, row in ROWS.items()}
    assert scenarios() == kept
    assert len({row["sha256"] for row in KEPT["rows"]}) == len(ROWS) == 10


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
