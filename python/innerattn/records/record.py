"""What a policy did in consecutive episodes: rescues, rewards and, where kept, every step."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from innerattn.config import Scenario
from innerattn.shown import Shown

FIELDS = (
    *("obs", "actions", "rewards", "positions", "velocities", "victims", "faults"),
    *("headings", "charge", "load", "heard", "rays", "attention"),
    "actor_attention",
)
"""What can be recorded step by step."""


Length = Literal["standard", "long"]
"""The scenario's own length of an episode, or the second one that policies are measured at."""


_EVENT = [(name, np.int64) for name in ("episode", "step", "slot", "victim", "task")]
LOST_DTYPE = np.dtype(_EVENT)
"""The fields of `Record.lost`."""


@dataclass(frozen=True, repr=False)
class Record(Shown):
    """Consecutive episodes of one policy.

    Fields with a time axis hold what was so before the step's action (rewards: what the step gave);
    they are None where they were not recorded and zero after an episode's end.

    Attributes:
        policy: its name.
        scenario: the worlds; `episode_steps` is T.
        robot_names: R names.
        seed: seed of the worlds.
        first_episode: number of the first episode.
        lengths: (E,) int64 steps of each episode.
        rescues: (N,) structured int64: episode, step, slot, victim, task, helper_0, ...;
            helper_k filled the task's need k, -1 beyond its last need; where needs are sums,
            the nearest helper comes first, and -1 is nobody.
        lost: (M,) structured int64: episode, step, slot, victim, task; victims that were lost.
        turned_away: (E,) int64 victims that arrived when all slots of their task were taken; None
            where victims come when others are gone.
        reward_names: C names of reward components.
        rewards_total: (E, R, C) float64 sum over the episode.
        length: which of an evaluation's two lengths of episodes this is.
        steps: by name, arrays (E, T, ...): obs (R, D) float32, actions (R,) int64 or (R, 2)
            float32, rewards (R, C) float32, positions and velocities (R, 2) float32, victims (V,)
            structured, faults (R,) structured, headings (R, 2) float32 (angles [rad] and turn rates
            [rad/s]), where some robots have a heading, charge and load (R,) float32, where some
            have a battery and a load, heard (R, R) bool (robot i hears robot j), where something
            limits communication, rays (R, K) float32 (1 - distance / range_m; 0: nothing is met, or
            the robot has fewer rays), where some have a range sensor, attention (H, R, R) float32
            of the critic, actor_attention (H, R, R) float32 of the actors, in which row i holds
            robot i's weights over its teammates.
    """

    policy: str
    scenario: Scenario
    robot_names: tuple[str, ...]
    seed: int
    first_episode: int
    lengths: NDArray[np.int64]
    rescues: NDArray[np.void]
    reward_names: tuple[str, ...]
    rewards_total: NDArray[np.float64]
    length: Length = "standard"
    lost: NDArray[np.void] = field(default_factory=lambda: np.empty(0, LOST_DTYPE))
    turned_away: NDArray[np.int64] | None = None
    steps: dict[str, NDArray[Any]] = field(default_factory=dict)

    def __repr__(self) -> str:
        """What it is of; its arrays would fill pages."""
        return (
            f"Record(policy={self.policy!r}, situation={self.scenario.situation!r}, "
            f"episodes={self.num_episodes}, rescues={len(self.rescues)}, steps={list(self.steps)})"
        )

    @property
    def num_episodes(self) -> int:
        """Number of episodes E."""
        return len(self.lengths)

    def rescue_counts(self) -> NDArray[np.int64]:
        """Rescues of each episode, (E,) int64."""
        index = self.rescues["episode"] - self.first_episode
        return np.bincount(index, minlength=self.num_episodes)


def rescue_dtype(scenario: Scenario) -> np.dtype[np.void]:
    """The fields of `Record.rescues`: as many helpers as any victim can have."""
    return np.dtype([*_EVENT, *((f"helper_{k}", np.int64) for k in range(scenario.max_helpers))])


def joined(parts: Sequence[Record], fields: Collection[str]) -> Record:
    """One record of consecutive episodes; what was recorded step by step of ``fields`` alone."""
    first = parts[0]
    counts = [part.turned_away for part in parts if part.turned_away is not None]
    return replace(
        first,
        lengths=np.concatenate([part.lengths for part in parts]),
        rescues=np.concatenate([part.rescues for part in parts]),
        lost=np.concatenate([part.lost for part in parts]),
        turned_away=np.concatenate(counts) if counts else None,
        rewards_total=np.concatenate([part.rewards_total for part in parts]),
        steps={name: np.concatenate([part.steps[name] for part in parts]) for name in fields},
    )
