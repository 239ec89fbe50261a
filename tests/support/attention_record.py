"""Records that hold nothing but attention, for tests."""

import numpy as np

from innerattn.config import Scenario
from innerattn.records.record import Record, rescue_dtype


def record_of(weights: np.ndarray, first_episode: int = 0, field: str = "attention") -> Record:
    """Episodes of the preset's four robots with ``weights`` (E, T, H, R, R) and no rescue."""
    scenario = Scenario()
    return Record(
        policy="p",
        scenario=scenario,
        robot_names=tuple(robot.name for robot in scenario.robots),
        seed=0,
        first_episode=first_episode,
        lengths=np.full(len(weights), weights.shape[1]),
        rescues=np.zeros(0, rescue_dtype(scenario)),
        reward_names=("rescue",),
        rewards_total=np.zeros((len(weights), 4, 1)),
        steps={field: weights.astype(np.float32)},
    )
