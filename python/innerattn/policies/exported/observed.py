"""What an observation has of a row with all teammates and all victims."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from innerattn.policies.exported.contract import Contract
from innerattn.policies.exported.layout import Layout, observed_teammates, observed_victims


@dataclass(frozen=True)
class Observed:
    """Takes the nearest teammates and the first victims out of whole rows.

    Attributes:
        own: columns of the robot itself.
        mate: columns of a teammate.
        seen: column among them that says whether it is seen; None where sight has no limit.
        teammates: how many teammates a whole row has.
        nearest: how many an observation has, the nearest first; None: all, in team order.
        end: column behind the last victim of an observation, in a whole row.
    """

    own: int
    mate: int
    seen: int | None
    teammates: int
    nearest: int | None
    end: int

    @classmethod
    def of(cls, contract: Contract, layout: Layout) -> Observed:
        """What observations of this team have."""
        limited = contract.scenario.get("observed_teammates") is not None
        teammates = len(contract.robots) - 1
        victims = observed_victims(contract)
        return cls(
            own=layout.own,
            mate=layout.mate,
            seen=layout.robot if layout.sight else None,
            teammates=teammates,
            nearest=observed_teammates(contract) if limited else None,
            end=layout.own + teammates * layout.mate + victims * layout.victim,
        )

    def row(self, whole: NDArray[np.float32]) -> NDArray[np.float32]:
        """The observation of a whole row; teammates of which nothing is known come last."""
        if self.nearest is None:
            return whole[: self.end]
        victims_from = self.own + self.teammates * self.mate
        blocks = whole[self.own : victims_from].reshape(self.teammates, self.mate)
        known = blocks.any(axis=1) if self.seen is None else blocks[:, self.seen] != 0.0
        far = blocks[:, 0] * blocks[:, 0] + blocks[:, 1] * blocks[:, 1]
        blocks = blocks[np.lexsort((far, ~known))[: self.nearest]]
        return np.concatenate([whole[: self.own], blocks.ravel(), whole[victims_from : self.end]])
