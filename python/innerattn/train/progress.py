"""How far a training is, as it reports it."""

from __future__ import annotations

from dataclasses import dataclass

from innerattn.train.checkpoint_info import Stage
from innerattn.train.metrics import Metrics


@dataclass(frozen=True)
class Progress:
    """How far training is; reported after every control step."""

    env_steps: int
    """Steps done in this stage, summed over worlds."""
    total_env_steps: int
    """Steps to do in this stage."""
    updates: int
    """Updates done in this stage; those of imitation do not count."""
    seconds: float
    """Time since this stage began [s]."""
    metrics: Metrics | None
    """The newest line of metrics, if there is one yet."""
    stage: Stage = "training"
    """A warm start imitates first; training is learning from rewards."""
