"""Scripted policies to measure trained ones against, from `random` to `planner` and `oracle`.

They see the true state of the worlds and plan for all worlds of a batch at once; none learns. Only
`oracle` knows of faults. `greedy-seen` uses of the state what each robot has seen itself or was
told by teammates.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection
from typing import Any

import numpy as np
from numpy.typing import NDArray

from innerattn.config import Scenario
from innerattn.envs.batch import NUM_DISCRETE_ACTIONS
from innerattn.errors import ConfigError
from innerattn.policies.policy import Policy, PolicyInput, WorldState
from innerattn.policies.scripted.assignment import (
    Needs,
    assign_whole_teams,
    can_be_rescued,
    pair_costs,
)
from innerattn.policies.scripted.charging import Charging
from innerattn.policies.scripted.coalitions import Coalitions
from innerattn.policies.scripted.loading import Loading
from innerattn.policies.scripted.lookahead import Lookahead
from innerattn.policies.scripted.steering import Steering
from innerattn.policies.scripted.sweeping import Sweep
from innerattn.policies.scripted.timing import Timing

_FAR_M2 = 1e6
"""More than the square of any distance in an arena [m²]."""


class RandomPolicy:
    """Every robot draws every action at random, all with the same chance."""

    name = "random"
    needs_true_state = False

    def __init__(self, scenario: Scenario, seed: int = 0) -> None:
        """Take the kind of actions from ``scenario``; ``seed`` fixes the draws.

        They follow each other: how many worlds are stepped at once decides who gets which.
        """
        self._continuous = scenario.actions == "continuous"
        self.reset(seed)

    def act(self, view: PolicyInput) -> NDArray[Any]:
        """See `Policy.act`."""
        envs, robots, _ = view.obs.shape
        if self._continuous:
            return self._rng.uniform(-1.0, 1.0, (envs, robots, 2)).astype(np.float32)
        return self._rng.integers(0, NUM_DISCRETE_ACTIONS, (envs, robots))

    def reset(self, seed: int) -> None:
        """See `Policy.reset`."""
        self._rng = np.random.default_rng(seed)


class _Dispatcher(ABC):
    """What all dispatching policies share: every step, targets first and then actions."""

    needs_true_state = True
    knows_faults = False
    """Whether the robots reckon with faults, or take all to be healthy."""

    def __init__(self, scenario: Scenario) -> None:
        """Take the team and the tasks from ``scenario``."""
        self.needs = Needs(scenario)
        self.steering = Steering(scenario)
        self._timing = Timing(scenario)
        self._coalitions = Coalitions(scenario)
        self._charging = Charging(scenario, self.steering)
        self._loading = Loading(scenario, self.steering, self._charging)

    def act(self, view: PolicyInput) -> NDArray[Any]:
        """See `Policy.act`; robots without a victim are drawn to the centre.

        Where there are depots or stations, those of them whose load or battery is not full are
        drawn to the nearest one, for a load first.
        """
        state = view.known_state
        places = np.stack([state.victims["x"], state.victims["y"]], -1).astype(np.float64)
        chosen = self.choose(state, places)
        targets = np.take_along_axis(places, np.maximum(chosen, 0)[..., None], 1)
        targets = np.where(chosen[..., None] >= 0, targets, self._idle(state))
        if self._charging.is_needed:
            targets = self._charging.targets(state, targets, chosen)
        if self._loading.is_needed:
            targets = self._loading.targets(state, targets, chosen)
        faults = self._faults(state)
        return self.steering.actions(
            state.positions, state.velocities, targets, faults, state.headings, state.obstacles
        )

    def reset(self, seed: int) -> None:
        """See `Policy.reset`; there is nothing to forget and nothing is drawn."""
        del seed

    def _idle(self, state: WorldState) -> NDArray[np.float64] | float:
        """Where robots without a victim go, in the form of (E, R, 2) [m]."""
        del state
        return 0.0

    def _times(
        self, state: WorldState, places: NDArray[np.float64], faults: NDArray[np.void] | None = None
    ) -> NDArray[np.float64]:
        """When robots could be at places (E, R, V) [s]."""
        return self.steering.arrival_times(
            state.positions, state.velocities, places, faults, state.headings, state.obstacles
        )

    def _faults(self, state: WorldState) -> NDArray[np.void] | None:
        return state.faults if self.knows_faults else None

    @abstractmethod
    def choose(self, state: WorldState, places: NDArray[np.float64]) -> NDArray[np.int64]:
        """The victim slot that each robot goes to (E, R), -1 for none; ``places`` are (E, V, 2)."""


class GreedyPolicy(_Dispatcher):
    """Every robot goes to the nearest victim that it can help, whatever the others do."""

    name = "greedy"

    def choose(self, state: WorldState, places: NDArray[np.float64]) -> NDArray[np.int64]:
        """See `_Dispatcher.choose`."""
        permitted = self.needs.permitted(state.victims["present"], state.victims["task"])
        if self._charging.is_needed:
            permitted &= self._charging.within_reach(state, places)[..., None]
        if self._loading.is_needed:
            permitted &= self._loading.can_help(state)[..., None, None]
        helpful = permitted.any(-1)
        way = places[:, None] - state.positions[:, :, None]
        distance = np.where(helpful, (way * way).sum(-1), np.inf)
        if self._timing.is_needed:
            times = self._times(state, places)
            if self._coalitions.is_needed:
                permitted = self._coalitions.alone(state, times, permitted)
            helpful &= self._timing.in_time(state, times, permitted)[:, None]
            distance = np.where(helpful, distance, np.inf)
            distance = np.where(helpful & self._timing.held(state, times), -1.0, distance)
        if self._timing.has_order:
            distance = distance + _FAR_M2 * state.victims["blocked"][:, None]
        return np.where(helpful.any(-1), distance.argmin(-1), -1)


class GreedySeenPolicy(_Dispatcher):
    """Every robot goes to the nearest victim that it can help and has seen, or searches.

    Where robots share victims, it has seen those that it was told of, too. Victims stay where they
    are, so one that was seen is known until all hear that it is gone. A robot that knows of none to
    help follows a place that sweeps the arena. It uses nothing of what it has not seen: neither
    victims nor teammates, nor whether somebody else makes it in time.
    """

    name = "greedy-seen"

    def __init__(self, scenario: Scenario) -> None:
        """Take the team and the tasks from ``scenario``."""
        super().__init__(scenario)
        self._sweep = Sweep(scenario, self.steering.speed)

    def choose(self, state: WorldState, places: NDArray[np.float64]) -> NDArray[np.int64]:
        """See `_Dispatcher.choose`."""
        victims = state.victims
        helpful = self.needs.permitted(victims["present"], victims["task"]).any(-1)
        if state.last_seen is not None:
            helpful &= state.last_seen[:, :, helpful.shape[1] :] >= 0
        if self._charging.is_needed:
            helpful &= self._charging.within_reach(state, places)
        if self._loading.is_needed:
            helpful &= self._loading.can_help(state)[..., None]
        way = places[:, None] - state.positions[:, :, None]
        distance = np.where(helpful, (way * way).sum(-1), np.inf)
        times = self._times(state, places)
        distance = np.where(helpful & self._timing.held(state, times), -1.0, distance)
        return np.where(helpful.any(-1), distance.argmin(-1), -1)

    def _idle(self, state: WorldState) -> NDArray[np.float64]:
        return self._sweep.places(state.step_counts)


class HungarianPolicy(_Dispatcher):
    """Robots are assigned to needs at the least total cost in arrival times, anew every step.

    Where needs are sums, the robots of a coalition are assigned in place of needs. Where a victim
    needs many robots, teams are formed one by one, if else nobody would be rescued.
    """

    name = "hungarian"

    def choose(self, state: WorldState, places: NDArray[np.float64]) -> NDArray[np.int64]:
        """See `_Dispatcher.choose`."""
        permitted = self.needs.permitted(state.victims["present"], state.victims["task"])
        faults = self._faults(state)
        needed = np.asarray(permitted.any(1))
        if faults is not None:
            permitted &= (faults["unavailable"] < 1.0)[:, :, None, None]
        if self._charging.is_needed:
            reached = self._charging.within_reach(state, places)
            ever = permitted & (reached | self._charging.within_full_reach(places))[..., None]
            permitted &= reached[..., None] & self._hopeful(state, ever, needed)
        if self._loading.is_needed:
            permitted &= self._loading.can_help(state)[..., None, None]
            if not self._loading.has_depots:
                permitted &= self._hopeful(state, permitted, needed)
        times = self._times(state, places, faults)
        blocked = state.victims["blocked"] if self._timing.has_order else None
        whole = needed if blocked is None else needed & ~blocked[..., None]
        if self._coalitions.is_needed:
            if blocked is not None:  # their coalitions would take robots from others
                permitted &= ~blocked[:, None, :, None]
            permitted, needed, short = self._coalitions.shared(state, times, permitted, needed)
            whole = needed & ~short[..., None]  # blocked victims are not needed any more
        if faults is not None:
            permitted &= can_be_rescued(permitted, needed)[:, None, :, None]
        held = None
        if self._timing.is_needed:
            permitted &= self._timing.in_time(state, times, permitted)[:, None, :, None]
            held = self._timing.held(state, times)
        costs = pair_costs(times, permitted, held, blocked)
        need = assign_whole_teams(costs, whole)
        return np.where(need >= 0, need // permitted.shape[-1], -1)

    def _hopeful(
        self, state: WorldState, permitted: NDArray[np.bool_], needed: NDArray[np.bool_]
    ) -> NDArray[np.bool_]:
        """Victims whose lists robots can fill, and all whose needs are sums (E, 1, V, 1).

        Arguments as of `can_be_rescued`. One robot may give all of a sum's abilities.
        """
        found = can_be_rescued(permitted, needed) | self._coalitions.of_sum(state)
        return np.asarray(found[:, None, :, None])


class PlannerPolicy(_Dispatcher):
    """Robots take the first step of a plan for all victims that are there, made anew every step."""

    name = "planner"

    def __init__(self, scenario: Scenario) -> None:
        """Take the team and the tasks from ``scenario``."""
        super().__init__(scenario)
        self._lookahead = Lookahead(
            scenario, self.steering, self._timing, self._charging, self._loading
        )

    def choose(self, state: WorldState, places: NDArray[np.float64]) -> NDArray[np.int64]:
        """See `_Dispatcher.choose`."""
        times = self._times(state, places)
        return self._lookahead.choose(state, places, times)


class OraclePolicy(HungarianPolicy):
    """As `hungarian`, and knows every fault.

    It reckons with weak, slow and misled drives, steers against a bias, and sends nobody who is
    never available, nor anybody to a victim that cannot be rescued without such a robot.
    """

    name = "oracle"
    knows_faults = True


SCRIPTED = ("random", "greedy", "hungarian")
"""Names of the scripted policies that every evaluation measures."""

SCRIPTS = (*SCRIPTED, "planner", "oracle", "greedy-seen")
"""Names of all scripted policies."""


def scripts_of(scenario: Scenario) -> tuple[str, ...]:
    """The scripted policies that evaluations in a scenario measure.

    `planner` is one of them where times, energy, sums or the order of tasks ask for plans, and
    `greedy-seen` where some robot does not see everything.
    """
    planner = ("planner",) if scenario.asks_for_plans else ()
    seen = ("greedy-seen",) if scenario.has_limited_sight else ()
    return (*SCRIPTED, *planner, *seen)


def best_script(measured: Collection[str]) -> str:
    """That of the measured scripts which has a score of 1."""
    return "planner" if "planner" in measured else "hungarian"


def scripted_policy(name: str, scenario: Scenario, seed: int = 0) -> Policy:
    """The scripted policy ``name`` for the team and tasks of ``scenario``.

    Raises:
        ConfigError: no such policy; the message names the known ones.
    """
    if name == "random":
        return RandomPolicy(scenario, seed)
    if name == "greedy":
        return GreedyPolicy(scenario)
    if name == "hungarian":
        return HungarianPolicy(scenario)
    if name == "planner":
        return PlannerPolicy(scenario)
    if name == "oracle":
        return OraclePolicy(scenario)
    if name == "greedy-seen":
        return GreedySeenPolicy(scenario)
    raise ConfigError(f"unknown policy {name!r}: known are {', '.join(SCRIPTS)}")
