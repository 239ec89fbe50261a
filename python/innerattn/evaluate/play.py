"""Runs a policy for whole episodes and records what happened; it measures nothing.

Every episode has a world of its own, fixed by seed and number, so two policies that are run with
the same seed meet the same starts.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from contextlib import closing
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from innerattn.config import Scenario
from innerattn.config.streams import Purpose, stream_seed
from innerattn.envs import BatchEnv
from innerattn.envs.senses import ray_columns
from innerattn.policies import Policy, PolicyInput, RememberingPolicy, WorldState
from innerattn.records.record import FIELDS, LOST_DTYPE, Record, joined, rescue_dtype

_WORLDS_AT_ONCE = 1024


@runtime_checkable
class Attentive(Protocol):
    """A policy with a critic whose attention, if it has any, can be recorded."""

    def attention(self, view: PolicyInput, actions: NDArray[Any]) -> NDArray[np.float32] | None:
        """Attention weights (E, H, R, R) for these actions; None where there are none."""


@runtime_checkable
class AttentiveActor(Protocol):
    """A policy with actors whose attention, if they have any, can be recorded."""

    def actor_attention(self, view: PolicyInput) -> NDArray[np.float32] | None:
        """Attention weights (E, H, R, R) on teammates, which rows of ``view`` have in their order.

        None where there are none.
        """


def run_episodes(
    policy: Policy,
    scenario: Scenario,
    episodes: int,
    seed: int,
    *,
    first_episode: int = 0,
    record: Collection[str] = (),
    num_threads: int | None = None,
    progress: Callable[[int], None] | None = None,
    purpose: Purpose = "evaluation",
) -> Record:
    """Run a policy for a number of episodes; it is reset first.

    Args:
        policy: what drives the robots.
        scenario: the worlds; `episode_steps` is the length.
        episodes: how many.
        seed: seed of the worlds, 0 to 2**63 - 1; with ``first_episode`` it fixes the starts.
        first_episode: number of the first episode.
        record: which of `FIELDS` to keep for every step; attention is kept only if the policy has
            it, actor_attention only if, besides, rows have all teammates in their order, headings,
            charge, load and rays only if some robots have such, and heard only if something limits
            communication.
        num_threads: threads that step the worlds; none: all cores.
        progress: called with the number of episodes each time some are done.
        purpose: "training" for the random streams that a training with this seed has; those of
            "evaluation" are none of a training's, whatever its seed.

    Returns:
        The record.

    Raises:
        ValueError: less than one episode, a seed out of range, or an unknown field to record.
    """
    if episodes < 1:
        raise ValueError(f"episodes = {episodes}: must be at least 1")
    unknown = set(record) - set(FIELDS)
    if unknown:
        raise ValueError(f"record = {sorted(unknown)}: known are {', '.join(FIELDS)}")
    streams = stream_seed(seed, purpose)
    policy.reset(_draw_seed(streams, first_episode))
    parts = []
    for start in range(first_episode, first_episode + episodes, _WORLDS_AT_ONCE):
        count = min(_WORLDS_AT_ONCE, first_episode + episodes - start)
        env = BatchEnv(
            scenario, count, seed=streams, num_threads=num_threads, first_env=start, copy=False
        )
        with closing(env):
            parts.append(_run_batch(policy, env, seed, start, record))
        if progress is not None:
            progress(count)
    return parts[0] if len(parts) == 1 else joined(parts, parts[0].steps)


def _draw_seed(seed: int, first_episode: int) -> int:
    """The seed of what a policy draws; later episodes have draws of their own."""
    if first_episode == 0:
        return seed
    return int(np.random.SeedSequence((seed, first_episode)).generate_state(1)[0])


def _run_batch(
    policy: Policy, env: BatchEnv, seed: int, first_episode: int, record: Collection[str]
) -> Record:
    """One episode of every world of ``env``; what happens after its end is not counted."""
    total_steps = env.scenario.episode_steps
    obs = env.reset()
    if isinstance(policy, RememberingPolicy):
        policy.forget()
    running = np.ones(env.num_envs, bool)
    lengths = np.zeros(env.num_envs, np.int64)
    rewards_total = np.zeros((env.num_envs, env.num_robots, len(env.reward_component_names)))
    steps: dict[str, NDArray[Any]] = {}
    rescues, lost = [], []
    turned_away = np.zeros(env.num_envs, np.int64) if env.scenario.has_arrivals else None
    rays = ray_columns(env)
    state_needed = policy.needs_true_state or not set(record).isdisjoint(WorldState._fields)
    for step_index in range(total_steps):
        state = WorldState.of(env) if state_needed else None
        view = PolicyInput(obs, state if policy.needs_true_state else None)
        actions = policy.act(view)
        seen: dict[str, NDArray[Any]] = {"obs": obs, "actions": actions}
        known = {} if state is None else state._asdict()
        seen |= {name: values for name, values in known.items() if values is not None}
        if "heard" in record and env.scenario.limits_communication:
            seen["heard"] = env.heard()
        if "rays" in record and rays:
            seen["rays"] = obs[..., rays]
        if "attention" in record and isinstance(policy, Attentive):
            weights = policy.attention(view, actions)
            seen |= {} if weights is None else {"attention": weights}
        if "actor_attention" in record and _in_order(env) and isinstance(policy, AttentiveActor):
            weights = policy.actor_attention(view)
            seen |= {} if weights is None else {"actor_attention": weights}
        for name in seen.keys() & set(record):
            _keep(steps, name, step_index, total_steps, seen[name], running)
        step = env.step(actions)
        rewards = env.reward_components()
        if "rewards" in record:
            _keep(steps, "rewards", step_index, total_steps, rewards, running)
        rewards_total[running] += rewards[running]
        lengths[running] += 1
        if len(step.rescues):
            rescues.append(step.rescues[running[step.rescues["env"]]].copy())
        if env.scenario.has_deadlines and len(gone := env.lost()):
            lost.append(gone[running[gone["env"]]])
        if turned_away is not None:
            turned_away += env.turned_away() * running
        obs = step.obs
        running &= ~(step.terminated | step.truncated)
        if not running.any():
            break
    return Record(
        policy=policy.name,
        scenario=env.scenario,
        robot_names=env.robot_names,
        seed=seed,
        first_episode=first_episode,
        lengths=lengths,
        rescues=_events(rescues, rescue_dtype(env.scenario), first_episode),
        lost=_events(lost, LOST_DTYPE, first_episode),
        turned_away=turned_away,
        reward_names=tuple(env.reward_component_names),
        rewards_total=rewards_total,
        steps={name: steps[name] for name in FIELDS if name in steps},
    )


def _in_order(env: BatchEnv) -> bool:
    """Whether each row has all teammates, in their order."""
    return env.scenario.observed_teammates is None


def _keep(
    steps: dict[str, NDArray[Any]],
    name: str,
    index: int,
    total: int,
    values: NDArray[Any],
    running: NDArray[np.bool_],
) -> None:
    """Put ``values`` (E, ...) at step ``index`` of the episodes that go on."""
    if name not in steps:
        steps[name] = np.zeros((len(values), total, *values.shape[1:]), values.dtype)
    steps[name][running, index] = values[running]


def _events(
    found: list[NDArray[np.void]], dtype: np.dtype[np.void], first_episode: int
) -> NDArray[np.void]:
    """The environment's events of all steps, in the order of episodes, then of time."""
    events = np.zeros(sum(map(len, found)), dtype)
    if found:
        raw = np.concatenate(found)
        for name in dtype.names or ():
            events[name] = raw["env" if name == "episode" else name]
        events["episode"] += first_episode
    return events[np.argsort(events["episode"], kind="stable")]
