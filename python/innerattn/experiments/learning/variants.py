"""Ways to train in which learning is studied; each is the plain one with one change."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from innerattn.experiments.plan import PlannedRun, plan

SITUATIONS = ("mixed", "double", "single")
"""The built-in scenarios that are learnt in, in the order of tables."""


@dataclass(frozen=True)
class Variant:
    """A change that all runs of a study have in common.

    Attributes:
        word: for the runs' names.
        changes: values by dotted key.
    """

    word: str
    changes: Mapping[str, object]

    def plan(
        self,
        methods: Sequence[str],
        situations: Sequence[str],
        seeds: Sequence[int],
        budget: str,
        out: Path,
        overrides: Mapping[str, object] | None = None,
    ) -> list[PlannedRun]:
        """The runs of a study with this change, as `innerattn.experiments.plan.plan` lists runs."""
        changes = {**(overrides or {}), **self.changes}
        return plan(methods, situations, seeds, budget, out, changes, self.word)


ENTITIES = Variant("entities", {"network.encoder": "entities"})
"""Networks that encode teammates and victims one by one."""
CONTINUOUS = Variant("continuous", {"scenario.actions": "continuous"})
"""Robots that command forces in the plane instead of one of five actions."""
WARM_START = Variant("from-hungarian", {"train.warm_start": "hungarian"})
"""Teams that imitate a script before they learn from rewards."""
LONG = Variant("long", {"train.env_steps": 30_000_000})
"""Three times the env-steps of the budget `strong`."""
AFTERSTATES = Variant("afterstates", {**LONG.changes, "ppo.bootstrap": "afterstate"})
"""As many env-steps, with the values of afterstates."""
