"""Rescue worlds for Python: batches, and a view for PettingZoo. Never imports torch."""

from innerattn.envs.batch import BatchEnv, Step
from innerattn.envs.parallel import parallel_env

__all__ = ["BatchEnv", "Step", "parallel_env"]
