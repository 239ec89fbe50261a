"""What a team retains when the robot fails that others attend to most, or least.

Of robots with one ability in common, any can do what another does; so what differs between their
failures is not what the team can do without them. Worlds are the same in all plays, and the same
as without a failure until it begins.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from innerattn.config import Scenario
from innerattn.evaluate.faults.grid import rescues_by_step
from innerattn.evaluate.faults.severity import fault_of
from innerattn.evaluate.play import run_episodes
from innerattn.measures.sharing.handoff import alike_robots
from innerattn.policies import Policy
from innerattn.records.record import Record

Counts = NDArray[np.int64]
Robots = NDArray[np.int64]


@dataclass(frozen=True)
class Failures:
    """Rescues from the onset on, and who is who; E episodes, A robots alike.

    Attributes:
        clean: (E,) rescues without a failure.
        faulty: (A, E) rescues when each of the robots alike fails.
        attended: (E, A) mean weight on each of them at the onset, over heads and all other robots.
        distance: (E, A) mean distance of each of them to all other robots at the onset [m].
        helper: (E,) which of them helps first from the onset on where nobody fails; -1: none does.
    """

    clean: Counts
    faulty: Counts
    attended: NDArray[np.float64]
    distance: NDArray[np.float64]
    helper: Robots

    def retained_most(self) -> float | None:
        """The share of rescues that is retained when the most attended one fails."""
        return self._retained(self.attended.argmax(1))

    def retained_least(self) -> float | None:
        """The same when the least attended one fails."""
        return self._retained(self.attended.argmin(1))

    def retained_nearest(self) -> float | None:
        """The same when the one fails that is nearest to the other robots."""
        return self._retained(self.distance.argmin(1))

    def attends_nearest(self) -> float:
        """Share of the episodes in which the nearest one is the most attended one."""
        return float((self.attended.argmax(1) == self.distance.argmin(1)).mean())

    def retained_helper(self) -> float | None:
        """The same when the one fails that would help first; of episodes that have one."""
        return self._retained(self.helper, self.helper >= 0)

    def retained_other(self) -> float | None:
        """The same when the next of them fails instead; of the same episodes."""
        return self._retained((self.helper + 1) % len(self.faulty), self.helper >= 0)

    def attends_helper(self) -> float | None:
        """Share of the episodes with a helper in which it is the most attended one."""
        some = self.helper >= 0
        hits = (self.attended.argmax(1) == self.helper)[some]
        return float(hits.mean()) if some.any() else None

    def _retained(self, failing: Robots, counted: NDArray[np.bool_] | None = None) -> float | None:
        """Rescues with the failing robot of each episode, as a share of those without a failure."""
        chosen = np.arange(len(self.clean)) if counted is None else np.flatnonzero(counted)
        whole = int(self.clean[chosen].sum())
        return float(self.faulty[failing[chosen], chosen].sum()) / whole if whole else None


def play_failures(
    policy: Policy,
    scenario: Scenario,
    onset_step: int,
    episodes: int,
    seed: int,
    *,
    num_threads: int | None = None,
    progress: Callable[[int], None] = lambda _: None,
) -> tuple[Record, Failures | None]:
    """Play without a failure, then with one of each of the robots alike from a step on.

    Args:
        policy: what drives the robots; its actors attend to teammates.
        scenario: the worlds, without faults of their own.
        onset_step: when the robot becomes unavailable, until the episode ends.
        episodes: how many.
        seed: of the worlds.
        num_threads: threads that step the worlds; none: all cores.
        progress: called with the number of episodes each time some are done.

    Returns:
        The record without a failure, with the attention of actors, and the failures; None where
        actors have no attention, or there are no two robots alike and another one.
    """

    def played(worlds: Scenario) -> Record:
        record = run_episodes(
            *(policy, worlds, episodes, seed),
            record=("actor_attention", "positions"),
            num_threads=num_threads,
        )
        progress(episodes)
        return record

    clean = played(scenario)
    alike = [clean.robot_names.index(name) for name in alike_robots(clean)]
    others = [robot for robot in range(scenario.num_robots) if robot not in alike]
    if "actor_attention" not in clean.steps or len(alike) < 2 or not others:
        return clean, None
    faulty = [
        played(
            scenario.replace(faults=(fault_of(scenario, robot, "unavailable", 1.0, onset_step),))
        )
        for robot in alike
    ]
    weights = clean.steps["actor_attention"][:, onset_step].astype(np.float64)
    places = clean.steps["positions"][:, onset_step].astype(np.float64)
    ways = np.linalg.norm(places[:, others, None] - places[:, None, alike], axis=-1)
    return clean, Failures(
        clean=rescues_by_step(clean)[:, onset_step:].sum(1),
        faulty=np.stack([rescues_by_step(one)[:, onset_step:].sum(1) for one in faulty]),
        attended=weights[:, :, others][..., alike].mean((1, 2)),
        distance=ways.mean(1),
        helper=first_helpers(clean, alike, onset_step),
    )


def first_helpers(record: Record, robots: list[int], onset_step: int) -> Robots:
    """Which of some robots helps first from a step on.

    Args:
        record: where to look.
        robots: indices of robots.
        onset_step: the first step that counts.

    Returns:
        (E,) indices in ``robots``; -1 where none of them helps.
    """
    found = np.full(record.num_episodes, -1, np.int64)
    names = [name for name in record.rescues.dtype.names or () if name.startswith("helper_")]
    for event in record.rescues:  # in the order of time
        episode = int(event["episode"]) - record.first_episode
        if event["step"] >= onset_step and found[episode] < 0:
            helping = [robots.index(int(event[n])) for n in names if int(event[n]) in robots]
            found[episode] = helping[0] if helping else -1
    return found
