"""What tells the runs of a study apart, and what runs of one seed have in common."""

from __future__ import annotations

from dataclasses import dataclass

from innerattn.config import EvaluateConfig

METHODS = ("td-inner", "td-uniform", "ppo-inner", "ppo-uniform")
"""The methods that are compared."""
SITUATIONS = ("single", "double", "mixed")
"""The built-in scenarios that they are compared in."""


@dataclass(frozen=True)
class Case:
    """What tells the runs of one study apart.

    Attributes:
        worlds: name of the built-in scenario, such as "mixed" or "mixed-8"; of other worlds their
            situation.
        method: value of `train.method`.
        seed: of training.
        variant: what else was changed, as a word; nothing in the paper's own comparison.
    """

    worlds: str
    method: str
    seed: int
    variant: str = ""

    @property
    def trained(self) -> str:
        """How it was trained, apart from the worlds and the seed."""
        return f"{self.method} {self.variant}".rstrip()

    def __str__(self) -> str:
        return f"{self.worlds} {self.trained} seed {self.seed}"


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
