"""Which runs a study needs, what each is made of and where it lies; it looks at no folder."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from innerattn.config import EvaluateConfig, RunConfig, load_run_config

METHODS = ("td-inner", "td-uniform", "ppo-inner", "ppo-uniform")
"""The methods that are compared."""
SITUATIONS = ("single", "double", "mixed")
"""The built-in scenarios that they are compared in."""


@dataclass(frozen=True)
class Case:
    """What tells the runs of one study apart.

    Attributes:
        situation: name of the built-in scenario, such as "mixed" or "mixed-8".
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


def planned_run(
    case: Case, budget: str, out: Path, overrides: Mapping[str, object] | None = None
) -> PlannedRun:
    """The run of a study that ``case`` names, in a folder of that name.

    It is what ``innerattn train --preset SITUATION --method METHOD --budget BUDGET --seed SEED
    --train.threads 1 --evaluate.seed WORLDS`` trains with ``overrides`` as further options; see
    `of_seed`.

    Args:
        case: which run; its variant only names what ``overrides`` change.
        budget: name of a built-in budget.
        out: folder of the study; its runs lie in ``runs``.
        overrides: values by dotted key.

    Raises:
        ConfigError: an unknown name, or a value that is not allowed.
    """
    values = {**(overrides or {}), **of_seed(case.seed)}
    config = load_run_config(case.situation, case.method, budget, overrides=values)
    words = (case.situation, case.method, case.variant, budget, f"s{case.seed}")
    return PlannedRun(case, config, out / "runs" / "-".join(filter(None, words)))


def plan(
    methods: Sequence[str],
    situations: Sequence[str],
    seeds: Sequence[int],
    budget: str,
    out: Path,
    overrides: Mapping[str, object] | None = None,
    variant: str = "",
) -> list[PlannedRun]:
    """The runs of a study, in the order in which they are trained; see `planned_run`.

    All runs of one seed come before those of the next, so that a study that is stopped has whole
    seeds.

    Args:
        methods: values of `train.method`.
        situations: names of built-in scenarios.
        seeds: seeds of training.
        budget: name of a built-in budget.
        out: folder of the study.
        overrides: values by dotted key that all runs share, e.g. to make them small.
        variant: a word for what these change, for the runs' names.

    Raises:
        ConfigError: an unknown name, or a value that is not allowed.
    """
    return [
        planned_run(Case(situation, method, seed, variant), budget, out, overrides)
        for seed in seeds
        for situation in situations
        for method in methods
    ]


def on_device(planned: Sequence[PlannedRun], device: str) -> list[PlannedRun]:
    """The same runs, trained on another device, such as "cuda"."""
    found = []
    for run in planned:
        train = run.config.train.model_copy(update={"device": device})
        found.append(replace(run, config=run.config.model_copy(update={"train": train})))
    return found


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
