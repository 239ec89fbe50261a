"""A policy for any team as numbers that a page computes with, for the team of one scenario."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import closing
from typing import Any

import numpy as np

from innerattn.config import RunConfig, Scenario
from innerattn.config.refusals import refuse_stores_drives_and_senses
from innerattn.config.team import TeamConfig
from innerattn.envs import BatchEnv
from innerattn.errors import ConfigError, RunError
from innerattn.policies.exported.pair_network import pair_shapes
from innerattn.policies.plain_team import PUSHES, newest_tensors, pair_network
from innerattn.policies.scripted.steering import Steering
from innerattn.records.run_files import RunFiles
from innerattn.report.page.weights import Weights


def any_team_document(
    files: RunFiles, config: RunConfig, team: TeamConfig, scenario: Scenario
) -> tuple[dict[str, Any], Weights]:
    """What the page's `AnyTeam` takes, as JSON, and its weights.

    Args:
        files: the run.
        config: its configuration.
        team: that of its method.
        scenario: the worlds it is to act in.

    Raises:
        RunError: its weights cannot be read, or are not those of such a policy.
        ConfigError: ``scenario`` has what such policies do not know.
    """
    _refuse(scenario)
    network, tensors = pair_network(team, scenario), newest_tensors(files)
    weights = Weights()
    for name, shape in pair_shapes(network).items():
        found = tensors.get(f"actor.{name}")
        if found is None or found.shape != shape:
            has = "none" if found is None else f"shape {found.shape}"
            raise RunError(f"{files.path}: its weights: actor.{name} has {has}, must have {shape}")
        weights.add(name, found[None])  # all robots have the one network there is
    with closing(BatchEnv(scenario, 1, num_threads=1)) as env:
        columns = env.observation_names()
    document = {
        "width": len(columns),
        "actions": len(PUSHES),
        "rows": [0] * scenario.num_robots,
        "greedy": config.evaluate.greedy_actions,
        "heads": 0,
        "available": -1,
        "frame": None,
        "pooling": network.pooling,
        "known": _known(scenario, columns),
    }
    return document, weights


def _refuse(scenario: Scenario) -> None:
    """Refuse what such policies do not know."""
    if scenario.actions != "discrete":
        raise ConfigError(
            f"scenario.actions = {scenario.actions!r}: must be 'discrete' for any team"
        )
    refuse_stores_drives_and_senses(scenario, "policies for any team")


def _known(scenario: Scenario, columns: Sequence[str]) -> dict[str, Any]:
    """What is known of a team beforehand, and where its observations hold the rest."""
    place = {name: column for column, name in enumerate(columns)}
    own = [name for name in columns if name.startswith("own.ability.")]
    abilities = [name.removeprefix("own.ability.") for name in own]

    def of_robot(who: str, relative: str) -> list[int]:
        vectors = [f"{relative}position.x", f"{relative}position.y"]
        vectors += [f"{relative}velocity.x", f"{relative}velocity.y"]
        has = [f"ability.{ability}" for ability in abilities]
        return [place[f"{who}.{quantity}"] for quantity in (*vectors, *has, "available")]

    def of_victim(who: str) -> list[int]:
        needs = [f"need.{ability}" for ability in abilities]
        way = ["relative_position.x", "relative_position.y"]
        return [place[f"{who}.{quantity}"] for quantity in ("present", *needs, *way)]

    def of_victims(what: str) -> list[int]:
        """That column of each victim; nothing where there is none."""
        names = (f"victim_{slot}.{what}" for slot in range(scenario.num_victims))
        return [place[name] for name in names if name in place]

    bodies = Steering(scenario).bodies().astype(np.float32)
    asked = [sum(task.amount(one) for task in scenario.tasks) for one in abilities]
    demand = np.array([total / len(scenario.tasks) for total in asked], np.float32)
    mates = range(len(scenario.robots) - 1)
    return {
        "team": [of_robot("own", ""), *(of_robot(f"teammate_{k}", "relative_") for k in mates)],
        "victims": [of_victim(f"victim_{slot}") for slot in range(scenario.num_victims)],
        "served": of_victims("served"),
        "timeLeft": of_victims("time_left"),
        "blocked": of_victims("blocked"),
        "services": [
            {"needs": [task.amount(one) for one in abilities], "seconds": task.service_s}
            for task in scenario.tasks
        ],
        "longestDeadline": scenario.longest_deadline_s,
        "bodies": bodies.tolist(),
        "demand": demand.tolist(),
        "half": scenario.arena_half_width_m,
        "radius": scenario.rescue_radius_m,
        "leave": scenario.robots_leave,
    }
