"""What can be added to a run: learning algorithms and attentions, by name.

A registration is plain data that names classes by module; a configuration does without torch, so
classes are imported only where they are built. Installed packages register theirs through the entry
point group `innerattn.extensions`.
"""

from __future__ import annotations

import logging
from collections.abc import Iterable, Mapping
from functools import cache
from importlib import import_module
from importlib.metadata import entry_points

from innerattn.config.algorithm import Algorithm, Method
from innerattn.config.ppo import PPO
from innerattn.config.td import TD
from innerattn.config.team import TEAM

EXTENSIONS = "innerattn.extensions"
"""Entry point group; every entry point names a module, which registers things when imported."""

_log = logging.getLogger(__name__)

_algorithms = {algorithm.name: algorithm for algorithm in (TD, PPO, TEAM)}
_attentions = {
    "inner": "innerattn.nn:InnerAttention",
    "uniform": "innerattn.nn:UniformAttention",
    "frozen": "innerattn.nn:FrozenAttention",
    "oracle": "innerattn.nn:OracleAttention",
    "max": "innerattn.nn:MaxAttention",
    "independent": "innerattn.nn:NoAttention",
}


def register_algorithm(algorithm: Algorithm) -> None:
    """Make the methods of an algorithm values of `train.method`.

    Raises:
        ValueError: Its name or one of its methods is taken.
    """
    if algorithm.name in _algorithms:
        raise ValueError(f"algorithm {algorithm.name!r} is registered already")
    taken = _methods_of(_algorithms.values()).keys() & _methods_of([algorithm]).keys()
    if taken:
        raise ValueError(
            f"algorithm {algorithm.name!r}: method {min(taken)!r} is registered already"
        )
    _algorithms[algorithm.name] = algorithm


def register_attention(name: str, attention: str) -> None:
    """Make an attention a value of `network.attention`, and of `train.method` after "ALGORITHM-".

    Args:
        name: One word.
        attention: Its class as "module:Class"; see `innerattn.nn.attention.TeammateAttention`.

    Raises:
        ValueError: The name is taken.
    """
    if name in (*_attentions, "none"):
        raise ValueError(f"attention {name!r} is registered already")
    _attentions[name] = attention


def algorithms() -> Mapping[str, Algorithm]:
    """All algorithms by name, those of installed packages included."""
    _load_extensions()
    return _algorithms


def attentions() -> Mapping[str, str]:
    """All attentions by name, as "module:Class", those of installed packages included."""
    _load_extensions()
    return _attentions


def methods() -> Mapping[str, Method]:
    """All methods by name, those of installed packages included."""
    return _methods_of(algorithms().values())


def _methods_of(algorithms: Iterable[Algorithm]) -> dict[str, Method]:
    found = {}
    for algorithm in algorithms:
        if algorithm.attends:
            for attention in _attentions:
                needs = {"network": {"attention": attention}}
                found[f"{algorithm.name}-{attention}"] = Method(algorithm, needs)
        for name, needs_of_method in algorithm.methods.items():
            found[name] = Method(algorithm, needs_of_method)
    return found


@cache
def _load_extensions() -> None:
    """Import the modules that installed packages name; leave out those that cannot be imported."""
    for extension in entry_points(group=EXTENSIONS):
        try:
            import_module(extension.value)
        except Exception as error:  # whatever somebody else's module raises
            _log.warning(
                "Extension %r is left out: %s cannot be imported (%s: %s)",
                extension.name,
                extension.value,
                type(error).__name__,
                error,
            )
