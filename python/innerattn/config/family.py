"""Families of teams: ranges from which scenarios are drawn whose teams can do their tasks."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from innerattn.config.model import ADDED_LATER, Model
from innerattn.config.scenario import Scenario
from innerattn.errors import ConfigError

Situation = Literal["single", "double", "mixed", "poisson"]
Share = Annotated[float, Field(ge=0.0, le=1.0)]
_Range = tuple[float, float]
_Count = Annotated[int, Field(ge=1)]
_Counts = tuple[_Count, _Count]
_TRIES = 1_000


class Family(Model):
    """Random teams, tasks and arenas. A range [low, high] includes both ends; draws are uniform.

    Raises:
        pydantic.ValidationError: (a `ValueError`) unknown key, wrong type, value out of range, or a
            range whose low end is above its high end.
    """

    place: ClassVar[str] = "family"

    robots: _Counts = Field((2, 12), description="robots of a team, at most 64")
    abilities: _Counts = Field((2, 5), description="abilities of a team together, at most 8")
    kinds: _Counts = Field(
        (2, 5), description="kinds of robots of a team; robots of a kind are alike"
    )
    all_unlike: Share = Field(0.35, description="share of teams with a kind for each robot")
    further_ability: Share = Field(
        0.25, description="how often a kind has one ability more, up to three"
    )
    max_speed_mps: _Range = Field((0.5, 1.9), description="speed limit of a kind [m/s]")
    mass_kg: _Range = Field((0.4, 1.5), description="mass of a kind [kg]")
    tasks: _Counts = Field((1, 3), description="kinds of victims")
    needs: tuple[_Count, ...] = Field(
        (1, 2, 2, 2, 3, 3), description="needs of a task; each entry is equally likely"
    )
    situations: tuple[Situation, ...] = Field(
        ("mixed", "mixed", "mixed", "double", "single"),
        description="situations; each entry is equally likely",
    )
    max_victims: _Counts = Field(
        (1, 6), description="most victims of a wave in mixed, and of each task at a time in poisson"
    )
    arrival_rate_hz: Annotated[_Range, ADDED_LATER] = Field(
        (0.3, 1.5), description="how many victims of a task arrive in poisson on average [1/s]"
    )
    arena_half_width_m: _Range = Field(
        (0.8, 1.2), description="half the side of the arena [m]; the high end grows with the team"
    )
    arena_growth_m: float = Field(
        0.1, ge=0.0, description="what each robot beyond four adds to the high end of that [m]"
    )
    usual_arena: Share = Field(0.4, description="share of teams in an arena as the scenario says")
    service: Share = Field(0.2, description="share of teams whose tasks have services")
    service_s: _Range = Field((0.3, 3.0), description="service of such a task [s]")
    deadline: Share = Field(0.1, description="share of teams whose tasks have deadlines")
    deadline_s: _Range = Field((2.0, 10.0), description="deadline of such a task [s]")
    order: Share = Field(
        0.2, description="share of teams in which each task but the first comes after another one"
    )
    unavailable: Share = Field(
        0.25, description="share of teams in which one or two robots are unavailable for a while"
    )

    @model_validator(mode="after")
    def _check(self) -> Self:
        for name, most in (("robots", 64), ("abilities", 8), ("kinds", 64), ("tasks", 32)):
            if getattr(self, name)[1] > most:
                raise ValueError(
                    f"{self.place}.{name} = {list(getattr(self, name))}: at most {most}"
                )
        for name in type(self).model_fields:
            value = getattr(self, name)
            if name in ("needs", "situations"):
                if not value:
                    raise ValueError(f"{self.place}.{name} = []: must have an entry")
            elif isinstance(value, tuple) and value[0] > value[1]:
                key = f"{self.place}.{name} = {list(value)}"
                raise ValueError(f"{key}: the low end must not be above the high end")
        return self

    def draw(self, seed: int, number: int, base: Scenario | None = None) -> Scenario:
        """Team ``number`` of the family, with a team that can do all tasks.

        Args:
            seed: of the family's draws; with ``number`` it fixes the scenario.
            number: which team.
            base: where the keys come from that the family does not draw; None: the defaults.

        Raises:
            ConfigError: no team of the family can do its tasks.
        """
        rng = np.random.default_rng([seed, number])
        base = Scenario() if base is None else base
        for attempt in range(_TRIES):
            try:
                timing = np.random.default_rng([seed, number, attempt, 1])
                return base.replace(**self._values(rng, timing, base))
            except ConfigError as error:
                reason = error
        raise ConfigError(
            f"{self.place}: none of {_TRIES} teams drawn can be used, the last because: {reason}"
        )

    def _values(
        self, rng: np.random.Generator, timing: np.random.Generator, base: Scenario
    ) -> dict[str, Any]:
        """What is drawn; ``timing`` draws how long tasks take and how many arrive, no more."""
        count = _whole(rng, self.robots)
        abilities = [f"ability_{index}" for index in range(_whole(rng, self.abilities))]
        team = self._team(rng, count, abilities)
        robots = [
            {"name": f"robot_{index}", **team[kind]}
            for index, kind in enumerate(_who(rng, count, len(team)))
        ]
        situation = str(rng.choice(self.situations))
        tasks = self._tasks(rng, count, abilities)
        values = {
            "situation": situation,
            "robots": robots,
            "tasks": tasks,
            "max_victims": min(_whole(rng, self.max_victims), max(2, count)),
            "faults": self._faults(rng, count, base.episode_steps),
        }
        self._let_tasks_take_time(timing, tasks)
        if situation == "poisson":
            for task in tasks:
                task["arrival_rate_hz"] = round(float(timing.uniform(*self.arrival_rate_hz)), 2)
        if rng.random() >= self.usual_arena:
            low, high = self.arena_half_width_m
            high += self.arena_growth_m * max(0, count - 4)
            values["arena_half_width_m"] = round(float(rng.uniform(low, high)), 2)
        return values

    def _team(
        self, rng: np.random.Generator, count: int, abilities: list[str]
    ) -> list[dict[str, Any]]:
        """The kinds of a team; each ability belongs to one at least, if there are enough."""
        unlike = rng.random() < self.all_unlike
        number = count if unlike else min(count, _whole(rng, self.kinds))
        kinds = []
        for index in range(number):
            first = index if index < len(abilities) else int(rng.integers(len(abilities)))
            own = {abilities[first]}
            while rng.random() < self.further_ability and len(own) < min(3, len(abilities)):
                own.add(str(rng.choice(abilities)))
            kinds.append(
                {
                    "kind": f"kind_{index}",
                    "abilities": sorted(own),
                    "max_speed_mps": round(float(rng.uniform(*self.max_speed_mps)), 2),
                    "mass_kg": round(float(rng.uniform(*self.mass_kg)), 2),
                }
            )
        return kinds

    def _tasks(
        self, rng: np.random.Generator, count: int, abilities: list[str]
    ) -> list[dict[str, Any]]:
        tasks = []
        for index in range(_whole(rng, self.tasks)):
            needs = min(int(rng.choice(self.needs)), count)
            chosen = [str(one) for one in rng.choice(abilities, needs)]
            tasks.append({"name": f"task_{index}", "needs": chosen})
        return tasks

    def _let_tasks_take_time(self, rng: np.random.Generator, tasks: list[dict[str, Any]]) -> None:
        """Give tasks services, deadlines and an order."""
        served, mortal, ordered = rng.random(3) < (self.service, self.deadline, self.order)
        for index, task in enumerate(tasks):
            if served:
                task["service_s"] = round(float(rng.uniform(*self.service_s)), 2)
                task["service"] = str(rng.choice(["keep", "restart"]))
            if mortal:
                least = float(rng.uniform(*self.deadline_s))
                task["deadline_s"] = round(least + task.get("service_s", 0.0), 2)
            if ordered and index:
                task["after"] = [f"task_{int(rng.integers(index))}"]

    def _faults(self, rng: np.random.Generator, count: int, steps: int) -> list[dict[str, Any]]:
        """Robots that are unavailable for a while: from the start or from a random step on."""
        if rng.random() >= self.unavailable:
            return []
        faults = []
        for robot in rng.choice(count, 1 if count < 6 else 2, replace=False):
            onset = 0 if rng.random() < 0.5 else int(rng.integers(max(1, steps - 5)))
            lasts = int(rng.integers(8, 40)) if rng.random() < 0.6 else None
            name = f"robot_{robot}"
            fault = {"robot": name, "kind": "unavailable", "value": 1.0, "onset_step": onset}
            faults.append(fault | ({} if lasts is None else {"duration_steps": lasts}))
        return faults


def _whole(rng: np.random.Generator, limits: tuple[int, int]) -> int:
    return int(rng.integers(limits[0], limits[1] + 1))


def _who(rng: np.random.Generator, count: int, kinds: int) -> list[int]:
    """The kind of each robot: each kind once, then at random, in random order."""
    who = [*range(kinds), *(int(rng.integers(kinds)) for _ in range(count - kinds))]
    return [int(kind) for kind in rng.permutation(who)]
