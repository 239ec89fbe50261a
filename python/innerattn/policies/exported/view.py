"""A policy for any team in onnxruntime: one file takes the view of a robot in any team."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from innerattn.policies.exported.backend import LOGITS, PROBABILITIES, onnx_session
from innerattn.policies.exported.contract import Contract
from innerattn.policies.exported.table import (
    ENDLESS_S,
    TableReader,
    bodies_of,
    demand_of,
    refuse_too_many_needs,
    too_large,
)

Array = NDArray[np.float32]

ROBOTS, VICTIMS, ABILITIES = "robots", "victims", "abilities"
"""Names of the sizes R, V and K in the file."""
VIEW: dict[str, tuple[str | int, ...]] = {
    "positions": (ROBOTS, 2),
    "velocities": (ROBOTS, 2),
    "bodies": (ROBOTS, 6),
    "abilities": (ROBOTS, ABILITIES),
    "present": (ROBOTS,),
    "victims": (VICTIMS, 2),
    "needs": (VICTIMS, ABILITIES),
    "waits": (VICTIMS, 3),
    "demand": (ABILITIES,),
    "world": (3,),
}
"""Inputs of the file and their sizes; see `docs/deployment.md`. All are float32, but for
``present``, which is bool. The robot itself is the first."""
_ACTIONS = 5


class ViewFile:
    """The file, which serves all robots."""

    def __init__(self, data: bytes, name: str, mark: str) -> None:
        """Load it; arguments and errors as of `onnx_session`."""
        sizes = [[one, *shape[1:]] for one, shape in VIEW.items()]
        self._session = onnx_session(data, name, mark, [*sizes, [LOGITS], [PROBABILITIES]])

    def logits(self, view: dict[str, NDArray[np.generic]]) -> Array:
        """Log-probabilities (5,) of the world's actions."""
        (found,) = self._session.run([LOGITS], view)
        return np.asarray(found)


class ViewActor:
    """The policy of one robot of a team; see `innerattn.policies.exported.backend.Actor`."""

    def __init__(self, contract: Contract, robot: int, file: ViewFile) -> None:
        """Prepare for a robot.

        Args:
            contract: of the team.
            robot: its number there.
            file: of the policy.

        Raises:
            ValueError: the columns of the contract are not those of its team.
        """
        rules = contract.network.pairs
        assert rules is not None  # as such a policy has them
        self._file, self._reader = file, TableReader(contract, robot)
        size = (contract.arena_half_width_m, rules.rescue_radius_m, contract.victim_slots)
        self._known = {
            "bodies": np.stack(bodies_of(contract, self._reader.order), axis=1),
            "demand": demand_of(contract),
            "world": np.array(size, np.float32),
        }

    def logits(self, rows: Array) -> Array:
        """Map observations (B, D) float32 to log-probabilities (B, 5) of the world's actions."""
        found = [self._log_probabilities(row) for row in rows]
        return np.array(found, np.float32).reshape(-1, _ACTIONS)

    def _log_probabilities(self, row: Array) -> Array:
        if too_large(row):
            return np.full(_ACTIONS, np.nan, np.float32)
        return self._file.logits(self.view(row))

    def view(self, row: Array) -> dict[str, NDArray[np.generic]]:
        """The inputs of the file, from a row (D,).

        Raises:
            ReadingError: a victim needs more than `MOST_NEEDS` abilities.
        """
        table = self._reader.table(row)
        refuse_too_many_needs(table.needs)
        waits = table.waits
        if waits is None:
            waits = np.zeros((len(table.needs), 3), np.float32)
            waits[:, 1] = ENDLESS_S
        return {
            "positions": table.places.T,
            "velocities": table.velocities.T,
            "abilities": table.abilities,
            "present": np.array(table.there),
            "victims": table.victims.T,
            "needs": table.needs,
            "waits": waits,
            **self._known,
        }
