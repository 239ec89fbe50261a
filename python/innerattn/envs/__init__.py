"""Rescue worlds for Python: batches, and views for the libraries that others use.

Nothing is imported before its name is asked for: Gymnasium, PettingZoo and TorchRL are needed for
their own views alone, torch for that of TorchRL.
"""

from typing import TYPE_CHECKING

from innerattn.lazy import lazy_names

if TYPE_CHECKING:
    from innerattn.envs.aec import env
    from innerattn.envs.batch import BatchEnv, Step
    from innerattn.envs.entities import Entities, EntityLayout
    from innerattn.envs.mixed import MixedBatchEnv, MixedStep
    from innerattn.envs.parallel import RescueParallelEnv, parallel_env
    from innerattn.envs.single import RescueEnv
    from innerattn.envs.torchrl import RescueTorchRLEnv
    from innerattn.envs.vector import RescueVectorEnv

__all__ = [
    "BatchEnv",
    "Entities",
    "EntityLayout",
    "MixedBatchEnv",
    "MixedStep",
    "RescueEnv",
    "RescueParallelEnv",
    "RescueTorchRLEnv",
    "RescueVectorEnv",
    "Step",
    "env",
    "parallel_env",
]

__getattr__ = lazy_names(
    __name__,
    {
        "BatchEnv": "batch",
        "Entities": "entities",
        "EntityLayout": "entities",
        "MixedBatchEnv": "mixed",
        "MixedStep": "mixed",
        "RescueEnv": "single",
        "RescueParallelEnv": "parallel",
        "RescueTorchRLEnv": "torchrl",
        "RescueVectorEnv": "vector",
        "Step": "batch",
        "env": "aec",
        "parallel_env": "parallel",
    },
    {"torchrl": "torchrl"},  # it brings torch, too
)
