"""What a configuration knows of a learning algorithm: its section, methods and learner."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib.resources.abc import Traversable
from typing import ClassVar, NamedTuple

from pydantic import Field

from innerattn.config.model import Model

Needs = Mapping[str, Mapping[str, object]]
"""Values that a method needs, by section and key."""


class AlgorithmConfig(Model, ABC):
    """Base of the configuration section of an algorithm; `place` is the name of the section.

    Attributes:
        for_any_team: Whether it learns one policy for any team, in teams of a family, too.
        remembers: Whether the learner's networks may have a memory (`network.memory_width`).
        speaks: Whether its policies may have messages (`network.message_width`).
    """

    for_any_team: ClassVar[bool] = False
    remembers: ClassVar[bool] = False
    speaks: ClassVar[bool] = False
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

    @property
    def batches(self) -> Mapping[str, int]:
        """Sizes that workers share among them beside the worlds, by key of the section."""
        return {}

    def check_memory(self) -> None:
        """Check keys that only matter where networks have a memory.

        Raises:
            ValueError: they contradict each other; the message begins with the key.
        """

    @property
    def needs_afterstates(self) -> bool:
        """Whether the learner asks for `innerattn.learn.types.Transitions.afterstates`."""
        return False


@dataclass(frozen=True)
class Algorithm:
    """A learning algorithm, as a configuration sees it.

    Attributes:
        config: Model of its section, with a default for every key.
        learner: Its learner as "module:Class"; see `innerattn.learn.types.LearnerClass`.
        attends: Whether its critic takes any registered attention, so that there is a method
            NAME-ATTENTION for each, e.g. "td-inner".
        methods: Further methods by name, with the values they need.
        averages_over_workers: Whether its learner averages what it learns from over
            `innerattn.learn.workers`, so that several processes can train it together.
        continuous: Values that its methods need where actions are continuous; None: they learn
            discrete actions only.
        budgets: Folder of what the algorithm changes in a built-in budget, BUDGET.toml; a budget
            without a file is not changed.
        warm_budgets: Likewise, on top of `budgets`, after a warm start.
    """

    config: type[AlgorithmConfig]
    learner: str
    attends: bool = False
    averages_over_workers: bool = False
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
