"""Contracts of all kinds of teams: rows built by them are those of the worlds, to the bit."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_export import readings_of

from innerattn.config import SCENARIOS, Robot, RunConfig, Scenario, Task
from innerattn.envs import BatchEnv
from innerattn.policies.exported.contract import WEIGHTS, Contract, contract_in, contract_text
from innerattn.policies.exported.readings import RowBuilder
from innerattn.train.export.document import contract_document, network_of


class Team:
    """What `readings_of` needs of a team."""

    def __init__(self, scenario: Scenario, names: list[str]) -> None:
        self.contract = contract_of(scenario, names)
        self.robot_names = tuple(robot.name for robot in self.contract.robots)


def contract_of(scenario: Scenario, names: list[str]) -> Contract:
    """The contract of a team in these worlds, of files that are not there."""
    config = RunConfig(scenario=scenario)
    robots = [robot.name for robot in scenario.robots]
    files = {name: f"{name}.onnx" for name in robots}
    document = contract_document(
        config,
        names,
        network_of(config, names, None),
        of_robot=robots,
        actors=files,
        weights_sha256="0" * 64,
        run={"method": "td-inner"},
        files=dict.fromkeys((WEIGHTS, *files.values()), b""),
    )
    return contract_in(contract_text(document))


WITHOUT_ROWS = ("mixed-faults", "mixed-radio", "mixed-sight", "mixed-wheels")
"""Presets whose rows follow from more than readings: senses fail, the sight is limited, or robots
have a heading."""


def check(scenario: Scenario, seed: int, worlds: int = 6) -> None:
    env = BatchEnv(scenario, worlds, seed=seed, num_threads=1)
    obs = env.reset()
    team = Team(scenario, env.observation_names())
    rng = np.random.default_rng(seed)
    robots = range(env.num_robots)
    builders = [RowBuilder(team.contract, robot, max_age_s=1.0) for robot in robots]
    for _ in range(3):
        for world in range(worlds):
            for robot, builder in enumerate(builders):
                readings = readings_of(team, team.robot_names[robot], env, world)  # type: ignore[arg-type]
                np.testing.assert_array_equal(builder.row(readings), obs[world, robot])
        for _ in range(4):
            obs = env.step(rng.integers(0, 5, (worlds, env.num_robots))).obs


@pytest.mark.parametrize("preset", [one for one in SCENARIOS if one not in WITHOUT_ROWS])
def test_rows_of_every_preset_are_those_of_the_worlds(preset: str) -> None:
    check(Scenario.preset(preset), seed=1)


@settings(max_examples=30)
@given(
    seed=st.integers(0, 2**32),
    robots=st.integers(1, 6),
    order=st.sampled_from(("relevant", "slot")),
)
def test_rows_of_random_teams_are_those_of_the_worlds(seed: int, robots: int, order: str) -> None:
    rng = np.random.default_rng(seed)
    team = []
    for number in range(robots):
        abilities = rng.choice(["water", "air", "rope", "light"], rng.integers(1, 4), replace=False)
        mass, speed = rng.uniform(0.3, 2.0), rng.uniform(0.2, 2.0)
        name = f"robot_{rng.integers(10)}_{number}"
        team.append(
            Robot(
                name=name, kind="any", abilities=tuple(abilities), mass_kg=mass, max_speed_mps=speed
            )
        )
    tasks = []
    for number in range(int(rng.integers(1, 4))):
        helpers = rng.permutation(robots)[: rng.integers(1, robots + 1)]
        needs = tuple(str(rng.choice(team[robot].abilities)) for robot in helpers)
        tasks.append(Task(name=f"task_{number}", needs=needs))
    scenario = Scenario(
        situation=str(rng.choice(["single", "double", "mixed"])),  # type: ignore[arg-type]
        robots=tuple(team),
        tasks=tuple(tasks),
        max_victims=int(rng.integers(1, 5)),
        victim_order=order,  # type: ignore[arg-type]
        observe_faults=bool(rng.integers(2)),
        rescue_radius_m=float(rng.uniform(0.1, 0.6)),
        episode_steps=7,
    )
    check(scenario, seed, worlds=3)
