"""What can be added to a run: learning algorithms and attentions, by name.

A registration is plain data that names classes by module; a configuration does without torch, so
classes are imported only where they are built. Installed packages register theirs through the entry
point group `innerattn.extensions`.
"""

from __future__ import annotations

import logging
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cache
from importlib import import_module
from importlib.metadata import entry_points
from importlib.resources.abc import Traversable
from typing import NamedTuple

from pydantic import Field

from innerattn.config.model import Model

EXTENSIONS = "innerattn.extensions"
"""Entry point group; every entry point names a module, which registers things when imported."""

_log = logging.getLogger(__name__)

Needs = Mapping[str, Mapping[str, object]]
"""Values that a method needs, by section and key."""


class AlgorithmConfig(Model, ABC):
    """Base of the configuration section of an algorithm; `place` is the name of the section."""

    gamma: float = Field(0.95, ge=0.0, le=1.0, description="discount per control step")

    @property
    @abstractmethod
    def rows_per_update(self) -> int:
        """Transitions that one update computes with; decides how many threads are worth it."""

    @abstractmethod
    def rows_of_training(self, env_steps: int) -> int:
        """Transitions that all updates of ``env_steps`` compute with, each as often as it is used.

        Decides whether compiling the update pays.
        """


@dataclass(frozen=True)
class Algorithm:
    """A learning algorithm, as a configuration sees it.

    Attributes:
        config: Model of its section, with a default for every key.
        learner: Its learner as "module:Class"; see `innerattn.learn.types.LearnerClass`.
        attends: Whether its critic takes any registered attention, so that there is a method
            NAME-ATTENTION for each, e.g. "td-inner".
        methods: Further methods by name, with the values they need.
        continuous: Values that its methods need where actions are continuous; None: they learn
            discrete actions only.
        budgets: Folder of what the algorithm changes in a built-in budget, BUDGET.toml; a budget
            without a file is not changed.
        warm_budgets: Likewise, on top of `budgets`, after a warm start.
    """

    config: type[AlgorithmConfig]
    learner: str
    attends: bool = False
    methods: Mapping[str, Needs] = field(default_factory=dict)
    continuous: Needs | None = None
    budgets: Traversable | None = None
    warm_budgets: Traversable | None = None

    @property
    def name(self) -> str:
        """Name of the algorithm and of its section."""
        return self.config.place


class Method(NamedTuple):
    """A value of `train.method`: an algorithm and the values that it needs, by section and key."""

    algorithm: Algorithm
    needs: Needs


_algorithms: dict[str, Algorithm] = {}
_attentions: dict[str, str] = {}


def register_algorithm(algorithm: Algorithm) -> None:
    """Make the methods of an algorithm values of `train.method`.

    Raises:
        ValueError: Its name or one of its methods is taken.
    """
    _register_ours()
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
    _register_ours()
    add_attention(name, attention)


def add_attention(name: str, attention: str) -> None:
    """The same for modules of this package, which are imported on the way to `_register_ours`."""
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


def _register_ours() -> None:
    """Import the modules of this package that register something, if nobody has done so before."""
    import innerattn.config.run  # noqa: F401


@cache
def _load_extensions() -> None:
    """Import the modules that installed packages name; leave out those that cannot be imported."""
    _register_ours()
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
