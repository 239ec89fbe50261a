"""What is known of a team beforehand, and tables of its worlds read from observations."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from innerattn.config import Scenario
from innerattn.config.refusals import refuse_stores_drives_and_senses
from innerattn.errors import ConfigError
from innerattn.nn.teams import TeamTables
from innerattn.nn.teams.tables import ENDLESS_S
from innerattn.policies.scripted.steering import Steering

SENSES = {
    "position_noise",
    "velocity_noise",
    "frozen_sensor",
    "blackout",
    "lost_communication",
}
"""Faults with which robots see different things."""


class TeamSheet:
    """One team: reads `TeamTables` from its observations.

    Attributes:
        num_robots: R.
        each_sees: whether each robot acts on what it sees itself, because senses may fail, or as a
            robot with a computer of its own does. Else all see the same, and one table of a world
            serves all.
    """

    def __init__(
        self, scenario: Scenario, names: Sequence[str], *, each_sees: bool = False
    ) -> None:
        """Take the team from ``scenario``; ``names`` are the columns of its observations.

        Args:
            scenario: the worlds.
            names: of the columns.
            each_sees: let each robot act on its own row, though no sense fails.

        Raises:
            ConfigError: actions are continuous or set velocities, or robots have a battery or a
                load, a limited sight or limited communication.
        """
        if scenario.actions != "discrete":
            raise ConfigError("scenario.actions = 'continuous': must be 'discrete' for any team")
        refuse_stores_drives_and_senses(scenario, "policies for any team")
        self.num_robots = len(scenario.robots)
        self.each_sees = each_sees or any(fault.kind in SENSES for fault in scenario.faults)
        self._leave = scenario.robots_leave
        self._bodies = torch.from_numpy(Steering(scenario).bodies().astype(np.float32))
        self._worlds = torch.tensor(
            [scenario.arena_half_width_m, scenario.rescue_radius_m, float(scenario.num_victims)]
        )
        place = {name: column for column, name in enumerate(names)}
        own = [name for name in names if name.startswith("own.ability.")]
        abilities = [name.removeprefix("own.ability.") for name in own]
        self._demand = torch.tensor(
            [
                sum(task.amount(ability) for task in scenario.tasks) / len(scenario.tasks)
                for ability in abilities
            ],
            dtype=torch.float32,
        )

        def columns(who: str, quantities: Sequence[str]) -> list[int]:
            return [place[f"{who}.{quantity}"] for quantity in quantities]

        has = [f"ability.{ability}" for ability in abilities]
        mates = [f"teammate_{k}" for k in range(self.num_robots - 1)]
        victims = [f"victim_{k}" for k in range(scenario.num_victims)]
        self._own_position = columns("own", ("position.x", "position.y"))
        self._own_velocity = columns("own", ("velocity.x", "velocity.y"))
        self._own_abilities, self._own_available = columns("own", has), place["own.available"]
        relative = ("relative_position.x", "relative_position.y")
        moving = ("relative_velocity.x", "relative_velocity.y")
        self._mate_positions = [columns(mate, relative) for mate in mates]
        self._mate_velocities = [columns(mate, moving) for mate in mates]
        self._mate_abilities = [columns(mate, has) for mate in mates]
        self._mate_available = [place[f"{mate}.available"] for mate in mates]
        self._present = [place[f"{victim}.present"] for victim in victims]
        self._needs = [columns(one, [f"need.{a}" for a in abilities]) for one in victims]
        self._places = [columns(victim, relative) for victim in victims]
        self._served, self._time_left, self._blocked = (
            [place[f"{victim}.{what}"] for victim in victims if f"{victim}.{what}" in place]
            for what in ("served", "time_left", "blocked")
        )
        self._services = torch.tensor([task.service_s for task in scenario.tasks])
        self._wanted = torch.tensor(
            [[task.amount(ability) for ability in abilities] for task in scenario.tasks],
            dtype=torch.float32,
        )
        self._longest_deadline_s = scenario.longest_deadline_s
        # For each robot, which teammates come before it in the team.
        robots = range(self.num_robots)
        self._order = torch.tensor(
            [[*range(1, i + 1), 0, *range(i + 1, len(robots))] for i in robots]
        )

    def tables(self, obs: Tensor) -> TeamTables:
        """Tables of worlds from observations (E, R, D) float32.

        Returns:
            B = E worlds; or, where `each_sees`, B = E * R, world by world what each robot sees.
        """
        if self.each_sees:
            return self._of_each(obs)
        positions = obs[..., self._own_position]
        available = obs[..., self._own_available] > 0.5
        # Of who sees the victims: all who are in the arena do.
        world, robot = torch.arange(len(obs)), available.int().argmax(1) if self._leave else 0
        return self._made(
            positions,
            obs[..., self._own_velocity],
            obs[..., self._own_abilities],
            available,
            obs[world, robot],
            positions[world, robot],
            heard=torch.ones_like(available),
        )

    def _of_each(self, obs: Tensor) -> TeamTables:
        rows = obs.flatten(0, 1)
        order = self._order.repeat(len(obs), 1)[..., None]

        def of_team(own: Tensor, mates: Tensor) -> Tensor:
            both = torch.cat([own[:, None], mates], 1)
            return both.gather(1, order.expand(-1, -1, both.shape[2]))

        own, velocity = rows[:, self._own_position], rows[:, self._own_velocity]
        own_can, ready = rows[:, self._own_abilities], rows[:, [self._own_available]]
        if self._mate_positions:
            ways, moving = rows[:, self._mate_positions], rows[:, self._mate_velocities]
            can, others = rows[:, self._mate_abilities], rows[:, self._mate_available, None]
        else:
            ways, moving, can, others = (x[:, None][:, :0] for x in (own, velocity, own_can, ready))
        # Of a teammate that is not heard all columns are zeros: it is as if it were not there.
        known = torch.cat([ways, moving, can, others], 2).any(2, keepdim=True)
        return self._made(
            of_team(own, ways + own[:, None]),
            of_team(velocity, moving + velocity[:, None]),
            of_team(own_can, can),
            of_team(ready, others).squeeze(2) > 0.5,
            rows,
            own,
            heard=of_team(torch.ones_like(ready, dtype=torch.bool), known).squeeze(2),
        )

    def _made(
        self,
        positions: Tensor,
        velocities: Tensor,
        abilities: Tensor,
        available: Tensor,
        seen: Tensor,
        own: Tensor,
        heard: Tensor,
    ) -> TeamTables:
        count, robots = positions.shape[:2]
        present = seen[:, self._present] > 0.5
        places = (seen[:, self._places] + own[:, None]) * present[..., None]
        needs = seen[:, self._needs] * present[..., None]
        return TeamTables(
            is_robot=torch.ones(count, robots, dtype=torch.bool),
            is_there=available if self._leave else heard,
            positions=positions,
            velocities=velocities,
            bodies=self._bodies.expand(count, -1, -1),
            abilities=abilities * available[..., None],
            is_victim=present,
            places=places,
            needs=needs,
            waits=self._waits(seen, needs) * present[..., None],
            demand=self._demand.expand(count, -1),
            worlds=self._worlds.expand(count, -1),
        )

    def _waits(self, seen: Tensor, needs: Tensor) -> Tensor:
        """(B, V, 3), as of `TeamTables`, from rows and needs of victims.

        Of tasks with the same needs, the longest service counts.
        """
        found = torch.zeros(*needs.shape[:2], 3)
        found[..., 1] = ENDLESS_S
        if self._served:
            alike = (needs.unsqueeze(2) == self._wanted).all(-1)  # (B, V, tasks)
            service = (alike * self._services).amax(-1)
            found[..., 0] = (1.0 - seen[:, self._served]) * service
        if self._time_left:
            share = seen[:, self._time_left]
            found[..., 1] = torch.where(share < 1.0, share * self._longest_deadline_s, ENDLESS_S)
        if self._blocked:
            found[..., 2] = seen[:, self._blocked]
        return found

    def own_rows(self, rows: Tensor) -> Tensor:
        """Of rows for all robots of all tables, (B * R, ...), those of who acts: (E * R, ...)."""
        if not self.each_sees:
            return rows
        robots = self.num_robots
        views = rows.view(-1, robots, robots, *rows.shape[1:])
        each = torch.arange(robots)
        return views[:, each, each].flatten(0, 1)


def as_tensor(obs: NDArray[np.float32]) -> Tensor:
    """A copy of observations, since worlds use their buffers again."""
    return torch.tensor(obs)
