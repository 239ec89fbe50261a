"""The tasks of a rescue world: kinds of victims, and when these arrive."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, field_validator
from pydantic_core import PydanticCustomError

from innerattn.config.amounts import Amounts, list_or_table
from innerattn.config.model import ADDED_LATER, Model, Told

_Seconds = Annotated[float, Told(0.001, 1e6)]


class Arrival(Model):
    """A victim that arrives at a given time."""

    at_s: Annotated[float, Told(0.0, 1e6)] = Field(
        description="when it arrives, after the start of an episode [s]"
    )
    task: str = Field(description="name of its task")
    position_m: tuple[float, float] = Field(description="where it is, inside wall_clearance_m [m]")


class Task(Model):
    """One kind of emergency: the abilities a victim needs, and how long it takes and waits."""

    name: str = Field(description="unique name; 1 to 64 letters, digits, '_' or '-'")
    needs: Annotated[tuple[str, ...], Told(1, 8)] | Amounts = Field(
        description="needed abilities: a list, each from a robot of its own, the same may stand "
        "twice; or a table of amounts, such as { water = 3.0 }, that the helpers must have together"
    )
    service_s: Annotated[float, ADDED_LATER, Told(0.0, 1e6)] = Field(
        0.0,
        description="how long all needs must be met before a victim is rescued [s]; 0: rescued at "
        "touch",
    )
    service: Annotated[Literal["keep", "restart"], ADDED_LATER] = Field(
        "keep",
        description="what happens to a service when the needs are not met any more; keep: it goes "
        "on later; restart: it starts anew",
    )
    deadline_s: Annotated[_Seconds | tuple[_Seconds, _Seconds] | None, ADDED_LATER] = Field(
        None,
        description="how long after it appeared a victim is lost, a number or a pair [low, high] "
        "that each victim's is drawn from [s]; None: never",
    )
    after: Annotated[tuple[str, ...], ADDED_LATER] = Field(
        (),
        description="names of the tasks that come before it: a victim waits while one of theirs is "
        "there that appeared no later",
    )
    arrival_rate_hz: Annotated[float, ADDED_LATER, Told(0.0, 100.0)] = Field(
        0.0,
        description="how many of its victims arrive on average, where the situation is poisson "
        "[1/s]",
    )
    area_m: Annotated[tuple[float, float, float, float] | None, ADDED_LATER] = Field(
        None,
        description="rectangle in which its victims appear: least x, least y, most x, most y [m]; "
        "None: as victim_area_m says",
    )

    _check_needs = field_validator("needs", mode="before")(list_or_table)

    @field_validator("deadline_s", mode="before")
    @classmethod
    def _number_or_pair(cls, value: object) -> object:
        if isinstance(value, (list, tuple)) and len(value) != 2:
            raise PydanticCustomError("type", "Input should be a number or a pair [low, high]")
        return value

    def holds(self, x: float, y: float) -> bool:
        """Whether a place is in its own area, border included; any is if it has none."""
        if self.area_m is None:
            return True
        left, bottom, right, top = self.area_m
        return left <= x <= right and bottom <= y <= top

    @property
    def roles(self) -> tuple[str, ...]:
        """The needs that a robot of its own meets each; none where needs are sums."""
        return () if isinstance(self.needs, dict) else self.needs

    @property
    def sums(self) -> Amounts:
        """The amounts that helpers must have together; none where needs are a list."""
        return self.needs if isinstance(self.needs, dict) else {}

    def amount(self, ability: str) -> float:
        """How much of an ability is needed: an amount, or how many robots."""
        if isinstance(self.needs, dict):
            return self.needs.get(ability, 0.0)
        return float(self.needs.count(ability))

    @property
    def deadlines_s(self) -> tuple[float, float] | None:
        """The least and the largest deadline [s]."""
        one = self.deadline_s
        return (one, one) if isinstance(one, float) else one
