"""Where a trained critic's attention goes when a robot fails: plays what has to be compared.

The same worlds are played without a fault and with each fault of each robot. For the results see
`innerattn.measures.faults.shift_results` and docs/robustness.md.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from innerattn.config.scenario import Fault
from innerattn.envs.batch import FAULT_KINDS
from innerattn.errors import RunError
from innerattn.evaluate.faults.severity import fault_of
from innerattn.evaluate.play import run_episodes
from innerattn.evaluate.trained import load_trained
from innerattn.measures.faults.label_shuffle import SHUFFLES
from innerattn.measures.faults.shift import (
    PairedRollouts,
    Pooled,
    areas_by_head,
    by_head,
    pooled_kinds,
    pooled_robots,
    shift_of,
)
from innerattn.measures.faults.shift_results import FaultAttention, KindShift
from innerattn.records.record import Record
from innerattn.stats.bootstrap import resampled_counts
from innerattn.train.build import thread_count, torch_threads

EPISODES = 100
"""Worlds that each fault is played in."""

ProgressCall = Callable[[int, int], None]
"""Called with the plays done and the plays to do; one play is of all worlds."""


def fault_attention_of_run(
    run: str | Path,
    *,
    kinds: Sequence[str] = FAULT_KINDS,
    episodes: int = EPISODES,
    steps: int | None = None,
    seed: int | None = None,
    progress: ProgressCall | None = None,
) -> FaultAttention:
    """Let each robot fail in each way in the middle of the episode, and see where attention goes.

    Args:
        run: the run folder; nothing is written into it.
        kinds: of faults.
        episodes: worlds that each fault is played in, E >= 1; areas take time in E squared.
        steps: length of an episode, T >= 2; none: twice that of training.
        seed: of the worlds, the bootstrap and the shuffled labels; none: as the configuration says.
        progress: called after each play.

    Raises:
        RunError: there is no readable run at ``run``, its critic has no attention, its team has
            fewer than three robots, or no episode goes on until the onset.
        ConfigError: its configuration is not valid.
        ValueError: an unknown kind or none, no episodes, or too few steps.
    """
    unknown = set(kinds) - set(FAULT_KINDS)
    if unknown or not kinds:
        raise ValueError(f"kinds = {sorted(unknown)}: must be some of {', '.join(FAULT_KINDS)}")
    if episodes < 1:
        raise ValueError(f"episodes = {episodes}: must be at least 1")
    config, policy = load_trained(run)
    robots = config.scenario.robots
    if config.network.attention == "none":
        raise RunError(f"{run}: the critic of {config.train.method} has no attention")
    if len(robots) < 3:
        raise RunError(f"{run}: attention has no choice in a team of {len(robots)}; 3 are needed")
    steps = 2 * config.scenario.episode_steps if steps is None else steps
    if steps < 2:
        raise ValueError(f"steps = {steps}: must be at least 2")
    seed = config.evaluate.seed if seed is None else seed
    worlds = config.scenario.replace(faults=(), episode_steps=steps)
    onset = steps // 2
    plays, total = 0, 1 + len(kinds) * len(robots)

    def play(*faults: Fault) -> Record:
        nonlocal plays
        record = run_episodes(
            policy,
            worlds.replace(faults=faults),
            episodes,
            seed,
            record=("attention",),
            num_threads=config.train.threads,
        )
        plays += 1
        if progress is not None:
            progress(plays, total)
        return record

    with torch_threads(thread_count(config)):
        healthy = play()
        counted = int((healthy.lengths > onset).sum())
        if not counted:
            raise RunError(f"{run}: no episode goes on until step {onset}, when the faults begin")
        draws = resampled_counts(counted, seed)
        shifts_of_kinds: list[KindShift] = []
        pools: list[Pooled] = []
        for kind in kinds:
            received, shifts = [], []
            for index, robot in enumerate(robots):
                fault = fault_of(worlds, index, kind, 1.0, onset)
                rollouts = paired_rollouts(play(fault), healthy, index, onset)
                received.append(rollouts.received())
                shifts.append(shift_of(robot.name, fault.value, rollouts, draws, seed))
            pools.append(pooled_robots(received))
            effect = by_head(pools[-1].effects, draws)
            auc = areas_by_head(pools[-1].comparison, draws)
            shifts_of_kinds.append(KindShift(kind, effect, auc, tuple(shifts)))
    overall = pooled_kinds(pools)
    return FaultAttention(
        attention=config.network.attention,
        seed=seed,
        episodes=episodes,
        counted=counted,
        episode_steps=steps,
        onset_step=onset,
        shuffles=SHUFFLES,
        even_share=1.0 / (len(robots) - 1),
        effect=by_head(overall.effects, draws),
        auc=areas_by_head(overall.comparison, draws),
        kinds=tuple(shifts_of_kinds),
    )


def paired_rollouts(faulty: Record, healthy: Record, robot: int, onset: int) -> PairedRollouts:
    """The attention of two records of the same worlds, in the episodes that reach the onset.

    Args:
        faulty: with a fault of one robot; attention is recorded.
        healthy: without; likewise.
        robot: the failing robot j.
        onset: the step at which its fault begins.
    """
    lengths = np.minimum(faulty.lengths, healthy.lengths)
    reached = lengths > onset
    happened = np.arange(faulty.scenario.episode_steps) < lengths[reached, None]
    with_fault, without = (record.steps["attention"][reached] for record in (faulty, healthy))
    return PairedRollouts(robot, onset, with_fault, without, happened)
