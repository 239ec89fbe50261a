"""Which robots go together to a victim whose needs are sums."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from innerattn.config import Scenario
from innerattn.policies.policy import WorldState

_Bools = NDArray[np.bool_]
_ROUNDING = 1e-9
"""A sum counts as reached from this share of the amount below it, as in the worlds."""


class Coalitions:
    """The sums that victims of a scenario need, and the robots that reach them soonest.

    A coalition is chosen as helpers are: the robots that arrive soonest, ties by index, until all
    sums are reached; then those that the others can do without are left out, the latest first.

    Attributes:
        is_needed: whether there are sums; where not, robots are assigned to needs alone.
    """

    def __init__(self, scenario: Scenario) -> None:
        """Take amounts from ``scenario``."""
        abilities = sorted({ability for task in scenario.tasks for ability in task.sums})
        self.is_needed = bool(abilities)
        self._is_sum = np.array([bool(task.sums) for task in scenario.tasks])
        self._needed = np.array(
            [[task.sums.get(one, 0.0) for one in abilities] for task in scenario.tasks]
        )
        self._given = np.array(
            [[robot.amount(one) for one in abilities] for robot in scenario.robots]
        )

    def alone(self, state: WorldState, times: NDArray[np.float64], permitted: _Bools) -> _Bools:
        """What is permitted if the robots of one coalition for each victim fill its needs.

        Each victim has its coalition as if it were the only one.

        Args:
            state: of the worlds.
            times: (E, R, V) arrival times [s].
            permitted: (E, R, V, N) which robot can fill which need, or give some of it.

        Returns:
            (E, R, V, N') bool; victims whose needs are a list keep theirs.
        """
        members, _ = self._members(state, times, np.asarray(permitted.any(-1)))
        return self._in_place_of_needs(state, members, times, permitted)

    def shared(
        self, state: WorldState, times: NDArray[np.float64], permitted: _Bools, needed: _Bools
    ) -> tuple[_Bools, _Bools, _Bools]:
        """The same where no robot is in two coalitions.

        The victim whose coalition is there soonest has it; then the next one has the soonest of the
        robots that are left, and so on. Where those left do not reach the sums, they may go to wait
        at victims whose coalition they would be in.

        Args:
            state: of the worlds.
            times: (E, R, V) arrival times [s].
            permitted: (E, R, V, N) which robot can fill which need, or give some of it.
            needed: (E, V, N) the needs that there are.

        Returns:
            What is permitted, (E, R, V, N') bool, and needed, (E, V, N') bool; and which victims
            need sums that no coalition of their own reaches, (E, V) bool.
        """
        worlds = np.arange(len(times))
        helpful = np.asarray(permitted.any(-1))
        of_sum = self.of_sum(state)
        free = np.ones(times.shape[:2], np.bool_)
        members = np.zeros(times.shape, np.bool_)
        open_ = of_sum.copy()
        for _ in range(times.shape[2]):
            found, reached = self._members(state, times, helpful & free[..., None])
            there = np.where(found, times, 0.0).max(1)
            there = np.where(open_ & reached, there, np.inf)
            victim = there.argmin(1)
            some = np.isfinite(there[worlds, victim])
            if not some.any():
                break
            chosen = found[worlds, :, victim] & some[:, None]
            members[worlds, :, victim] |= chosen
            free &= ~chosen
            open_[worlds[some], victim[some]] = False
        waiting, _ = self._members(state, times, helpful)
        members |= waiting & free[..., None] & open_[:, None]
        slots = self._in_place_of_needs(state, members, times, permitted)
        listed = np.zeros((*needed.shape[:2], slots.shape[-1]), np.bool_)
        listed[..., : needed.shape[-1]] = needed
        return slots, np.where(of_sum[..., None], slots.any(1), listed), open_

    def of_sum(self, state: WorldState) -> _Bools:
        """Which victims need sums, (E, V)."""
        present = state.victims["present"]
        return np.asarray(present & self._is_sum[np.where(present, state.victims["task"], 0)])

    def _members(
        self, state: WorldState, times: NDArray[np.float64], candidates: _Bools
    ) -> tuple[_Bools, _Bools]:
        """The coalitions of candidates (E, R, V), and whether they reach the sums, (E, V).

        Where all candidates do not reach them, there is none.
        """
        of_sum = self.of_sum(state)
        task = np.where(of_sum, state.victims["task"], 0)
        least = (self._needed[task] * (1.0 - _ROUNDING))[:, None]  # (E, 1, V, A)
        order = np.where(candidates, times, np.inf).argsort(1, kind="stable")
        given = self._given[order] * np.take_along_axis(candidates, order, 1)[..., None]
        before = given.cumsum(1) - given
        taken = ~(before >= least).all(-1)  # (E, R, V) in order of arrival
        reached = np.asarray((given.sum(1) >= least[:, 0]).all(-1) & of_sum)
        total = (given * taken[..., None]).sum(1)
        for place in reversed(range(times.shape[1])):
            without = total - given[:, place]
            spare = taken[:, place] & (without >= least[:, 0]).all(-1)
            taken[:, place] &= ~spare
            total = np.where(spare[..., None], without, total)
        members = np.zeros_like(taken)
        np.put_along_axis(members, order, taken & reached[:, None], 1)
        return members, reached

    def _in_place_of_needs(
        self,
        state: WorldState,
        members: _Bools,
        times: NDArray[np.float64],
        permitted: _Bools,
    ) -> _Bools:
        """What is permitted, with a need of its own for each member of a coalition."""
        most = max(permitted.shape[-1], int(members.sum(1).max(initial=0)))
        order = np.where(members, times, np.inf).argsort(1, kind="stable").argsort(1, kind="stable")
        own = members[..., None] & (order[..., None] == np.arange(most))
        listed = np.zeros(own.shape, np.bool_)
        listed[..., : permitted.shape[-1]] = permitted
        return np.where(self.of_sum(state)[:, None, :, None], own, listed)
