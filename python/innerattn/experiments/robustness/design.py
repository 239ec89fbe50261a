"""Which runs meet which faults, and which of them in the same worlds; it looks at no folder."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Literal

from innerattn.envs.batch import FAULT_KINDS
from innerattn.experiments.plan import METHODS, SITUATIONS, Case

Part = Literal["deployment", "training", "teams"]
"""deployment: teams trained without faults; training: beside them, teams trained with faults;
teams: by their size."""

TRAINED = "td-inner"
"""The method of training with faults, and of teams by their size; both are in mixed."""
WITH_FAULTS = "mixed-faults"
"""The built-in scenario of training with faults."""
MASKED, TEAM = "masked", "team"
"""Variants: unavailable robots are kept out of the critic's attention; a team of some size."""
TEAMS = ("mixed-1-food", "mixed", "mixed-4-food", "mixed-8", "mixed-16")
"""The built-in scenarios whose teams differ in size, for as many victims."""
TEAM_BUDGET = "quick"
"""The budget of these teams, whatever that of the other runs."""


@dataclass(frozen=True)
class Group:
    """Runs that meet the same faults in the same worlds.

    Attributes:
        part: of the study.
        name: that no other group has.
        cases: the runs, in the order of tables.
        kinds: of faults.
        episodes: worlds in which each fault is tried.
    """

    part: Part
    name: str
    cases: tuple[Case, ...]
    kinds: tuple[str, ...] = FAULT_KINDS
    episodes: int = 100


def groups(cases: Collection[Case]) -> list[Group]:
    """The groups of planned runs."""
    found = []
    for seed in sorted({case.seed for case in cases}):
        for situation in SITUATIONS:
            own = tuple(x for m in METHODS if (x := Case(situation, m, seed)) in cases)
            if own:
                found.append(Group("deployment", f"{situation}-s{seed}", own))
        faulty = (
            Case(WITH_FAULTS, TRAINED, seed),
            Case(WITH_FAULTS, TRAINED, seed, MASKED),
            Case("mixed", TRAINED, seed),
        )
        if set(faulty) <= set(cases):
            found.append(Group("training", f"trained-with-faults-s{seed}", faulty))
    for name in TEAMS:
        if (team := Case(name, TRAINED, 0, TEAM)) in cases:
            found.append(Group("teams", f"team-{name}", (team,), ("unavailable",), 200))
    return found
