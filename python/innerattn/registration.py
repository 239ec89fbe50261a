"""Makes `innerattn/Rescue-v0` known to Gymnasium, and imports neither Gymnasium nor a world."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib.machinery import ModuleSpec, PathFinder
from types import ModuleType

ENV_ID = "innerattn/Rescue-v0"
"""Name of a rescue world for `gymnasium.make` and `gymnasium.make_vec`."""


def register_with_gymnasium() -> None:
    """Register `ENV_ID`: now if Gymnasium is imported already, else as soon as it is."""
    if sys.modules.get("gymnasium") is not None:
        _register()
    else:
        sys.meta_path.insert(0, _AfterGymnasium())


def _register() -> None:
    from gymnasium.envs.registration import register, registry

    if ENV_ID not in registry:
        register(
            ENV_ID,
            entry_point="innerattn.envs.single:RescueEnv",
            vector_entry_point="innerattn.envs.vector:RescueVectorEnv",
        )


class _AfterGymnasium:
    """Watches imports for that of Gymnasium; finds nothing else."""

    def find_spec(
        self, name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Gymnasium's spec, with a loader that registers when it is done."""
        spec = PathFinder.find_spec(name, path, target) if name == "gymnasium" else None
        if spec is None or spec.loader is None:
            return None
        load = spec.loader.exec_module

        def load_and_register(module: ModuleType) -> None:
            load(module)
            _register()

        spec.loader.exec_module = load_and_register  # type: ignore[method-assign]
        return spec
