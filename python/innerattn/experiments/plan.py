"""Which runs a study needs, what each is made of and where it lies; it looks at no folder."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from innerattn.config import EvaluateConfig, RunConfig, load_run_config

METHODS = ("td-inner", "td-uniform", "ppo-inner", "ppo-uniform")
"""The methods that are compared."""
SITUATIONS = ("single", "double", "mixed")
"""The built-in scenarios that they are compared in."""
TARGETS: Mapping[str, tuple[str, ...]] = {
    "table2": METHODS,
    "fig4": METHODS,
    "fig5": tuple(method for method in METHODS if method.endswith("-inner")),
    "all": METHODS,
    "crossed": tuple(method for method in METHODS if method.startswith("td-")),
}
"""What can be reproduced, with the methods that it needs. All is what the paper shows, in every
situation; the crossed design is apart, see `innerattn.experiments.crossed`."""


@dataclass(frozen=True)
class Case:
    """What tells the runs of one study apart.

    Attributes:
        situation: name of the built-in scenario.
        method: value of `train.method`.
        seed: of training.
        variant: what else was changed, as a word; nothing in the paper's own comparison.
    """

    situation: str
    method: str
    seed: int
    variant: str = ""

    @property
    def trained(self) -> str:
        """How it was trained, apart from the situation and the seed."""
        return f"{self.method} {self.variant}".rstrip()

    def __str__(self) -> str:
        return f"{self.situation} {self.trained} seed {self.seed}"


@dataclass(frozen=True)
class PlannedRun:
    """A run that a study needs.

    Attributes:
        case: which one it is.
        config: what it is trained with.
        folder: where it lies, or will.
    """

    case: Case
    config: RunConfig
    folder: Path


def plan(
    methods: Sequence[str],
    situations: Sequence[str],
    seeds: Sequence[int],
    budget: str,
    out: Path,
    overrides: Mapping[str, object] | None = None,
) -> list[PlannedRun]:
    """The runs of a study, in the order in which they are trained.

    Each is what ``innerattn train --preset SITUATION --method METHOD --budget BUDGET --seed SEED
    --train.threads 1 --evaluate.seed WORLDS`` trains, see `of_seed`. All runs of one seed come
    before those of the next, so that a study that is stopped has whole seeds.

    Args:
        methods: values of `train.method`.
        situations: names of built-in scenarios.
        seeds: seeds of training.
        budget: name of a built-in budget.
        out: folder of the study; its runs lie in ``runs``.
        overrides: values by dotted key that all runs share, e.g. to make them small.

    Raises:
        ConfigError: an unknown name, or a value that is not allowed.
    """
    return [
        PlannedRun(
            Case(situation, method, seed),
            load_run_config(
                situation,
                method,
                budget,
                overrides={**(overrides or {}), **of_seed(seed)},
            ),
            out / "runs" / f"{situation}-{method}-{budget}-s{seed}",
        )
        for seed in seeds
        for situation in situations
        for method in methods
    ]


def of_seed(seed: int) -> dict[str, object]:
    """Values by dotted key of a run with this seed of training, in a study.

    Runs of one seed are measured in the same worlds, so that they can be compared pairwise; runs of
    different seeds in different ones, so that chance of the worlds is part of what differs between
    seeds, which are the unit of every claim.
    """
    return {
        "train.seed": seed,
        "train.threads": 1,
        "evaluate.seed": EvaluateConfig().seed + seed,
    }
