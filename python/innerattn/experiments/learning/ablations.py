"""What each choice of the recipe for PPO is worth: the recipe beside itself with one change."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from innerattn.experiments.learning.recipe import ABLATIONS, RECIPE, Ablation
from innerattn.experiments.learning.study import BySeed, Learnt, read_learning
from innerattn.experiments.paper.claims import LEAST_PAIRS
from innerattn.experiments.run import FinishedRun
from innerattn.stats.comparison import Contrast, contrast

MARGIN = 0.05
"""Smaller differences of scores count as none."""


@dataclass(frozen=True)
class Ablated:
    """What one change does to what is learnt, in one situation.

    Attributes:
        ablation: the change.
        learnt: with it.
        score: score with it minus score of the recipe, seed by seed, in episodes of the standard
            length; None where fewer than `LEAST_PAIRS` seeds have both, or all differ alike.
        long_score: the same in episodes of the second length.
    """

    ablation: Ablation
    learnt: Learnt
    score: Contrast | None
    long_score: Contrast | None


@dataclass(frozen=True)
class Ablations:
    """The recipe and its changes.

    Attributes:
        recipe: what it learns, by situation.
        ablated: by situation, then in the order of `ABLATIONS`.
    """

    recipe: tuple[Learnt, ...]
    ablated: tuple[Ablated, ...]


def read_ablations(runs: Sequence[FinishedRun]) -> Ablations:
    """Compare the recipe with its changes; runs are read only.

    Raises:
        RunError: there are no runs, or runs of one change cannot be compared.
    """
    by_word: dict[str, list[FinishedRun]] = {}
    for run in runs:
        # As an archive has it: the course of training is not needed.
        by_word.setdefault(run.case.variant, []).append(replace(run, archived=True))
    learnt = {
        word: {one.situation: one for one in read_learning(group).learnt}
        for word, group in by_word.items()
    }
    recipe = learnt.get(RECIPE.word, {})
    return Ablations(
        recipe=tuple(recipe.values()),
        ablated=tuple(
            _ablated(one, learnt[one.variant.word][situation], recipe.get(situation))
            for situation in dict.fromkeys(run.situation for run in runs)
            for one in ABLATIONS
            if situation in learnt.get(one.variant.word, {})
        ),
    )


def _ablated(one: Ablation, changed: Learnt, recipe: Learnt | None) -> Ablated:
    if recipe is None:
        return Ablated(one, changed, None, None)
    score = _difference(changed.seeds, changed.score, recipe.seeds, recipe.score)
    long_score = _difference(changed.seeds, changed.long_score, recipe.seeds, recipe.long_score)
    return Ablated(one, changed, score, long_score)


def _difference(
    seeds: Sequence[int], changed: BySeed, recipe_seeds: Sequence[int], recipe: BySeed
) -> Contrast | None:
    ours = dict(zip(recipe_seeds, recipe.each, strict=True))
    pairs = [
        (new, old)
        for seed, new in zip(seeds, changed.each, strict=True)
        if new is not None and (old := ours.get(seed)) is not None
    ]
    return contrast(pairs, (1.0, -1.0), MARGIN) if len(pairs) >= LEAST_PAIRS else None
