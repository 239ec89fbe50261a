"""A script that plans with the robots that are in the arena, while others wait outside."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from innerattn.config import Scenario
from innerattn.errors import ConfigError
from innerattn.policies.policy import Policy, PolicyInput, WorldState


class CrewPolicy:
    """Acts for those that are there as a script does in a world without the others.

    Own robots that are out count, too, while those that are there cannot do every task: scripts
    send them, and the others wait. Who does not count stays where it is.
    """

    needs_true_state = True

    def __init__(
        self, make: Callable[[Scenario], Policy], scenario: Scenario, num_own: int
    ) -> None:
        """Begin with the scenario's own robots.

        Args:
            make: makes the script for the team of a scenario.
            scenario: the worlds, with all robots that can be there.
            num_own: how many robots, the first ones, are the scenario's own; the others are spare.
        """
        self._make, self._scenario, self._num_own = make, scenario, num_own
        self._seed = 0
        self._scripts: dict[tuple[int, ...], tuple[list[int], Policy]] = {}
        self.name = make(scenario).name

    def act(self, view: PolicyInput) -> NDArray[Any]:
        """See `Policy.act`; of one world."""
        state = view.known_state
        away = state.faults["unavailable"][0] >= 1.0
        crew, script = self._script(tuple(np.flatnonzero(~away).tolist()))
        part = PolicyInput(view.obs[:, crew], _state_of(state, crew))
        chosen = script.act(part if script.needs_true_state else PolicyInput(part.obs))
        actions = np.zeros((1, away.size, *chosen.shape[2:]), chosen.dtype)
        actions[:, crew] = chosen
        return actions

    def reset(self, seed: int) -> None:
        """See `Policy.reset`."""
        self._seed = seed
        self._scripts.clear()

    def _script(self, there: tuple[int, ...]) -> tuple[list[int], Policy]:
        """The robots that count while some are there, and their script."""
        if there not in self._scripts:
            crew, scenario = self._crew(list(there))
            script = self._make(scenario)
            script.reset(self._seed)
            self._scripts[there] = crew, script
        return self._scripts[there]

    def _crew(self, there: list[int]) -> tuple[list[int], Scenario]:
        """The robots that count, and the worlds with them alone."""
        try:
            return there, self._with(there)
        except ConfigError:
            every = sorted({*range(self._num_own), *there})
            return every, self._with(every)

    def _with(self, robots: list[int]) -> Scenario:
        known = self._scenario.robots
        return self._scenario.replace(
            robots=[known[index] for index in robots], faults=(), observed_teammates=None
        )


def _state_of(state: WorldState, robots: list[int]) -> WorldState:
    """The part of a state that is of some robots."""

    def part(values: NDArray[Any] | None) -> Any:
        return None if values is None else values[:, robots]

    seen = state.last_seen
    if seen is not None:
        others = [*robots, *range(state.positions.shape[1], seen.shape[2])]
        seen = seen[:, robots][:, :, others]
    return state._replace(
        positions=part(state.positions),
        velocities=part(state.velocities),
        faults=part(state.faults),
        charge=part(state.charge),
        load=part(state.load),
        headings=part(state.headings),
        last_seen=seen,
    )
