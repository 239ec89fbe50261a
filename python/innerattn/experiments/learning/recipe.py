"""The recipe for PPO, and the same recipe with one change each: what is planned."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from innerattn.experiments.learning.variants import Variant
from innerattn.experiments.plan import PlannedRun


@dataclass(frozen=True)
class Ablation:
    """The recipe with one change.

    Attributes:
        choice: what the recipe has.
        instead: what these runs have.
        variant: the change, and the word for it.
    """

    choice: str
    instead: str
    variant: Variant


def _ablation(choice: str, instead: str, word: str, **changes: object) -> Ablation:
    named = {key.replace("__", "."): value for key, value in changes.items()}
    return Ablation(choice, instead, Variant(word, named))


def _constant(value: float) -> dict[str, float]:
    return {"first": value, "last": value}


RECIPE = Variant("", {})
"""The budget as it is."""
ABLATIONS: tuple[Ablation, ...] = (
    _ablation("canonical frames", "the world's frame", "world-frame", network__symmetry="none"),
    _ablation(
        "canonical frames", "worlds turned at random", "augmented", network__symmetry="augmented"
    ),
    _ablation(
        "robots of a kind share parameters",
        "each has its own",
        "own-parameters",
        network__parameter_sharing="none",
    ),
    _ablation(
        "rescues pay the team",
        "rescues pay the helpers",
        "helpers-credit",
        train__schedule__team_credit=_constant(0.0),
    ),
    _ablation(
        "dense reward from 0.3 to 0",
        "dense reward 1 throughout",
        "dense",
        train__schedule__dense_weight=_constant(1.0),
    ),
    _ablation(
        "dense reward from 0.3 to 0",
        "no dense reward",
        "sparse",
        train__schedule__dense_weight=_constant(0.0),
    ),
    _ablation("γ = 0.98", "γ = 0.95", "gamma-0.95", ppo__gamma=0.95),
    _ablation("λ = 0.8", "λ = 0.95", "lambda-0.95", ppo__gae_lambda=0.95),
    _ablation("step size 0.004", "0.001", "slow", ppo__learning_rate=0.001),
    _ablation(
        "step size falls to 1 %", "stays", "constant-step", ppo__final_learning_rate_share=1.0
    ),
    _ablation(
        "entropy weight from 0.015 to 0.0003",
        "0.01 throughout",
        "constant-entropy",
        train__schedule__entropy_weight=_constant(0.01),
    ),
    _ablation("two epochs", "one", "one-epoch", ppo__epochs=1),
    _ablation("minibatches of 512 rows", "of 2,048", "large-batches", ppo__minibatch_size=2_048),
    _ablation("width 64", "width 128", "wide", network__hidden_width=128),
    _ablation("episodes of 50 steps", "of 25", "short-episodes", train__episode_steps=25),
    _ablation("trained on `discs`", "on `rapier`", "rapier", train__engine="rapier"),
    _ablation("counterfactual baseline", "value head", "value-head", ppo__advantage="value"),
    _ablation(
        "no potential",
        "potential of `hungarian`",
        "potential",
        train__potential="hungarian",
    ),
    _ablation(
        "value of the next state",
        "of its afterstate",
        "afterstate",
        ppo__bootstrap="afterstate",
        ppo__afterstate_epochs=10,
    ),
    _ablation(
        "value of the next state",
        "of its afterstate, fitted in two passes",
        "afterstate-two-passes",
        ppo__bootstrap="afterstate",
    ),
)
"""One change each, in the order of the table."""


def plan_ablations(
    methods: Sequence[str],
    situations: Sequence[str],
    seeds: Sequence[int],
    budget: str,
    out: Path,
    overrides: Mapping[str, object] | None = None,
) -> list[PlannedRun]:
    """The recipe's runs and those of all `ABLATIONS`, whole seeds after each other."""
    variants = (RECIPE, *(one.variant for one in ABLATIONS))
    return [
        run
        for seed in seeds
        for variant in variants
        for run in variant.plan(methods, situations, (seed,), budget, out, overrides)
    ]
