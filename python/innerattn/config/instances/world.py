"""One world to be measured in: a scenario whose victims are listed, and what a script reached."""

from __future__ import annotations

from typing import Annotated, Any, Self

from pydantic import Field, model_validator

from innerattn.config.instances.instance import NAME
from innerattn.config.model import Model
from innerattn.config.scenario import Scenario


class Reference(Model):
    """What a policy reached in a world: scores are relative to it."""

    policy: str
    """Its name."""
    rescued: Annotated[int, Field(gt=0)]
    """Victims that it rescued."""
    makespan_s: Annotated[float, Field(gt=0)]
    """When the last victim was rescued or lost [s]."""


class WorldInstance(Model):
    """A world with robots that have bodies, and a list of victims.

    Raises:
        pydantic.ValidationError: (a `ValueError`) unknown key, wrong type, value out of range, or a
            scenario that has no list of victims and no end when all are done.
    """

    name: Annotated[str, Field(pattern=NAME)]
    feature: Annotated[str, Field(pattern=NAME)]
    """What is special about it; results are given for each feature."""
    scenario: Scenario
    reference: Reference

    @model_validator(mode="after")
    def _check(self) -> Self:
        if not self.scenario.end_when_done:
            raise ValueError(f"{self.name}.scenario.end_when_done = false: must be true")
        if not self.scenario.arrivals:
            raise ValueError(f"{self.name}.scenario.arrivals = []: must have an entry")
        return self

    @property
    def victims(self) -> int:
        """How many victims arrive."""
        return len(self.scenario.arrivals)

    @property
    def can_lose(self) -> bool:
        """Whether victims can be lost; then rescues count, and elsewhere time does."""
        return any(task.deadline_s is not None for task in self.scenario.tasks)

    def written(self) -> dict[str, Any]:
        """As an entry of a file; keys of the scenario that have their defaults are left out."""
        scenario = self.scenario.model_dump(mode="json", exclude_defaults=True)
        return {**self.model_dump(mode="json"), "scenario": scenario}
