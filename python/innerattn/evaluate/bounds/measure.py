"""The robustness bounds of eqs. 5-9, held against trained networks in states of their own play.

The inequalities and their proofs are in docs/attention-bound.md. It measures networks; what the
team achieves with a faulty robot is not measured here.
"""

from __future__ import annotations

import copy
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from innerattn.config import RunConfig
from innerattn.envs import BatchEnv
from innerattn.errors import RunError
from innerattn.evaluate.bounds.disturb import Changed, Direction, disturb
from innerattn.evaluate.bounds.inequalities import head_norms
from innerattn.evaluate.bounds.perturbation import random_directions, rms_norm
from innerattn.evaluate.bounds.response import States
from innerattn.evaluate.bounds.results import Attention, Bounds, Level, level_of
from innerattn.evaluate.play import run_episodes
from innerattn.evaluate.trained import TrainedPolicy
from innerattn.learn.actor_critic import ActorCritic
from innerattn.learn.framed import as_seen, unframed
from innerattn.learn.types import Learner
from innerattn.nn import Actor, CentralCritic, Critic, InnerAttention, JointCritic
from innerattn.train import load_policy
from innerattn.train.build import thread_count, torch_threads

RADII = (0.01, 0.03, 0.1, 0.3, 1.0)
"""Sizes of a change, as shares of the root mean square norm of what is changed, robot by robot."""
DRAWS = 8
"""Random directions for each robot and state; every radius has the same."""
STATES = 64
"""States that are disturbed, each from an episode of its own."""

ProgressCall = Callable[[int, int], None]
"""Called with the levels measured and the levels to measure."""

_CHANGES: dict[Attention, tuple[tuple[Changed, Direction], ...]] = {
    "inner": (
        ("embedding", "random"),
        ("embedding", "gradient"),
        ("observation", "random"),
        ("observation", "gradient"),
        ("observation", "gradient_own"),
    ),
    "uniform": (("embedding", "random"), ("observation", "random")),
    "none": (("observation", "random"),),
}
"""What can be changed and aimed at: only inner attention has logits, only attention embeddings."""


def measure_bounds(
    critic: Critic | JointCritic | CentralCritic,
    actor: Actor,
    states: States,
    seed: int,
    progress: ProgressCall | None = None,
) -> Bounds:
    """Disturb each robot in turn and hold what moves against the bounds, all in float64.

    Without learnt attention no logit exists and nothing is bounded: of uniform attention it is
    measured that its weights stay, of all critics how far their values move.

    Args:
        critic: with inner or uniform attention, or without any; it is copied.
        actor: the policies; likewise.
        states: B states of R >= 2 robots.
        seed: of the random directions.
        progress: called after each level.

    Raises:
        ValueError: there is one robot alone.
    """
    if len(states.obs) < 2:
        raise ValueError("1 robot: there is no teammate to attend to; at least 2 are needed")
    critic = copy.deepcopy(critic).double().requires_grad_(False)
    actor = copy.deepcopy(actor).double().requires_grad_(False)
    attention: Attention = "none"
    inputs = {"observation": states.obs}
    heads: dict[str, Tensor] = {}
    if isinstance(critic, Critic):
        attention = "uniform"
        inputs["embedding"] = critic.encode(states.obs, states.actions)[1]
        if isinstance(critic.attention, InnerAttention):
            attention = "inner"
            matrices = {"query": critic.attention.query, "key": critic.attention.key}
            heads = {name: head_norms(x, critic.attention.heads) for name, x in matrices.items()}
    norms = {name: rms_norm(x) for name, x in inputs.items()}
    source = torch.Generator().manual_seed(seed)
    units = {
        name: random_directions((len(x), DRAWS, *x.shape[1:]), source) for name, x in inputs.items()
    }
    levels: list[Level] = []
    total = len(_CHANGES[attention]) * len(RADII)
    for changed, direction in _CHANGES[attention]:
        for radius in RADII:
            drawn = radius * norms[changed].view(-1, 1, 1, 1) * units[changed]
            measured = disturb(critic, actor, states, changed, direction, drawn)
            levels.append(level_of(changed, direction, radius, measured))
            if progress is not None:
                progress(len(levels), total)
    values = critic(*states).q.flatten(1)
    return Bounds(
        attention=attention,
        seed=seed,
        states=states.obs.shape[1],
        draws=DRAWS,
        query_norms=_floats(heads.get("query")),
        key_norms=_floats(heads.get("key")),
        embedding_norms=_floats(norms.get("embedding")),
        observation_norms=_floats(norms["observation"]),
        value_standard_deviation=float(values.var(1, correction=0).mean().sqrt()),
        levels=tuple(levels),
    )


def bounds_of_run(
    run: str | Path,
    *,
    states: int = STATES,
    seed: int | None = None,
    progress: ProgressCall | None = None,
) -> Bounds:
    """The bounds of a run's newest networks, in states of their own play.

    Args:
        run: the run folder; nothing is written into it.
        states: how many; each is from a random step of an episode of its own.
        seed: of the worlds, the steps and the random directions; none: as the configuration says.
        progress: called after each level.

    Raises:
        RunError: there is no readable run at ``run``, its team is one robot, its actions are
            continuous, its robots have a memory or messages, or its critic is of an extension.
        ConfigError: its configuration is not valid.
    """
    config, learner = load_policy(run)
    if config.scenario.num_robots < 2:
        raise RunError(f"{run}: its team is one robot; attention needs a teammate")
    if config.scenario.actions == "continuous":
        raise RunError(
            f"{run}: scenario.actions = 'continuous': bounds count changes of the likeliest of "
            "'discrete' actions"
        )
    inner = unframed(learner)
    if (
        config.network.attention not in _CHANGES
        or not isinstance(inner, ActorCritic)
        or not isinstance(inner.actor, Actor)
        or not isinstance(inner.critic, Critic | JointCritic | CentralCritic)
    ):
        raise RunError(
            f"{run}: train.method = {config.train.method!r}: bounds are known only for built-in "
            "critics with inner, uniform or no attention, and robots without memory and messages"
        )
    seed = config.evaluate.seed if seed is None else seed
    with torch_threads(thread_count(config)):
        played = played_states(config, learner, states, seed)
        return measure_bounds(inner.critic, inner.actor, played, seed, progress)


def played_states(config: RunConfig, learner: Learner, count: int, seed: int) -> States:
    """States that a policy comes to: a random step of each of ``count`` episodes."""
    policy = TrainedPolicy(learner, config.train.method, greedy=config.evaluate.greedy_actions)
    record = run_episodes(
        policy,
        config.scenario,
        count,
        seed,
        record=("obs", "actions"),
        num_threads=config.train.threads,
    )
    step = np.random.default_rng(seed).integers(0, record.lengths)
    obs, actions = (
        torch.tensor(record.steps[name][np.arange(count), step]) for name in ("obs", "actions")
    )
    obs, actions = as_seen(learner, obs, actions)
    obs, actions = obs.transpose(0, 1), actions.t()
    available = None
    if config.network.mask_unavailable:
        with closing(BatchEnv(config.scenario, 1, num_threads=1)) as env:
            column = env.observation_names().index("own.available")
        available = (obs[:, :, column] > 0.5).t()
    return States(obs.double(), actions, available)


def _floats(x: Tensor | None) -> tuple[float, ...]:
    return () if x is None else tuple(x.tolist())
