"""Rescue worlds for Python: batches, and a view for PettingZoo. Never imports torch.

Gymnasium and PettingZoo are imported when `parallel_env` is first asked for.
"""

from typing import TYPE_CHECKING, Any

from innerattn.envs.batch import BatchEnv, Step

if TYPE_CHECKING:
    from innerattn.envs.parallel import parallel_env

__all__ = ["BatchEnv", "Step", "parallel_env"]


def __getattr__(name: str) -> Any:
    if name != "parallel_env":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from innerattn.envs.parallel import parallel_env

    return parallel_env
