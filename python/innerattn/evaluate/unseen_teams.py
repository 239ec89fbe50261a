"""What one policy for any team scores in 24 teams that it has never met.

Which teams they are was fixed before any policy was measured on them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import lru_cache
from typing import Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray

from innerattn.config import Scenario
from innerattn.config.family import Family
from innerattn.evaluate.play import run_episodes
from innerattn.policies import Policy, scripted_policy

Group = Literal["mixtures", "sizes", "bodies", "changes"]
GROUPS: tuple[Group, ...] = get_args(Group)
"""Draws of the family; sizes from 2 to 24; bodies outside its ranges; robots that are there for
half of the time, or become slow."""
EPISODE_STEPS = 50
SEED = 20_261
"""Of the 24 teams and their worlds; a training draws its teams from other streams."""
_SIZES = (2, 3, 5, 7, 10, 14, 18, 24)
_BODIES = (
    ("max_speed_mps", (2.0, 2.6)),
    ("max_speed_mps", (0.3, 0.45)),
    ("mass_kg", (2.0, 4.0)),
    ("mass_kg", (0.2, 0.35)),
)
_HALF = EPISODE_STEPS // 2
_CHANGES: tuple[tuple[str, dict[str, str | int | float]], ...] = (
    ("one leaves at half time", {"kind": "unavailable", "onset_step": _HALF}),
    ("one joins at half time", {"kind": "unavailable", "duration_steps": _HALF}),
    ("one slows to a quarter", {"kind": "speed_limit", "onset_step": _HALF, "value": 0.25}),
    ("one leaves at half time", {"kind": "unavailable", "onset_step": _HALF}),
)
_REFERENCES = ("random", "greedy", "hungarian")


class UnseenTeam(NamedTuple):
    """A team and its worlds.

    Attributes:
        group: what is unusual about it.
        told: the same, in the words of a table.
        scenario: the worlds.
    """

    group: Group
    told: str
    scenario: Scenario


class TeamScore(NamedTuple):
    """What a policy does in a team.

    Attributes:
        team: which one.
        score: of the policy: 0 rescues as many as `random`, 1 as many as `hungarian`.
        greedy: score of the script `greedy`.
        most: rescues per episode of `hungarian`.
        more: (episodes,) rescues of the policy minus those of `hungarian`, which plays the same
            worlds.
    """

    team: UnseenTeam
    score: float
    greedy: float
    most: float
    more: NDArray[np.int64]


@lru_cache(maxsize=2)
def unseen_teams(seed: int = SEED) -> tuple[UnseenTeam, ...]:
    """The 24 teams; another seed draws others of the same groups."""
    return tuple(_drawn(seed))


def _drawn(seed: int) -> Iterator[UnseenTeam]:
    usual = Family(unavailable=0.0, service=0.0, deadline=0.0, order=0.0)
    base = Scenario(episode_steps=EPISODE_STEPS)
    for number in range(8):
        yield UnseenTeam("mixtures", "unseen mixture", usual.draw(seed, number, base))
    for number, size in enumerate(_SIZES, start=100):
        family = usual.replace(robots=(size, size), kinds=(min(2, size), min(5, size)))
        yield UnseenTeam("sizes", "unseen size", family.draw(seed, number, base))
    for number, (key, limits) in enumerate(_BODIES, start=200):
        scenario = usual.replace(**{key: limits}).draw(seed, number, base)
        yield UnseenTeam("bodies", "unseen bodies", scenario)
    for number, (told, fault) in enumerate(_CHANGES, start=300):
        scenario = usual.replace(robots=(5, 8)).draw(seed, number, base)
        changed = {"robot": scenario.robots[0].name, "value": 1.0, **fault}
        yield UnseenTeam("changes", told, scenario.replace(faults=[changed]))


def scores_in_unseen_teams(
    policy_for: Callable[[Scenario], Policy],
    episodes: int,
    *,
    seed: int = SEED,
    num_threads: int | None = None,
    progress: Callable[[int], None] = lambda _: None,
) -> Iterator[TeamScore]:
    """Play a policy in all teams; each plays the worlds that scripts play.

    Args:
        policy_for: the policy for the worlds of a team.
        episodes: of each policy in each team.
        seed: of the teams and their worlds.
        num_threads: threads that step the worlds; none: all cores.
        progress: called with the number of teams that are done.

    Returns:
        One by one, in the order of `unseen_teams`.
    """
    for number, team in enumerate(unseen_teams(seed)):
        scripted = [_scripted(name, seed, number, episodes, num_threads) for name in _REFERENCES]
        own = _rescues(policy_for(team.scenario), team.scenario, seed, episodes, num_threads)
        least, greedy, most = (float(one.mean()) for one in scripted)
        score, other = ((one - least) / (most - least) for one in (float(own.mean()), greedy))
        progress(number + 1)
        yield TeamScore(team, score, other, most, own - scripted[-1])


@lru_cache(maxsize=4 * 24)
def _scripted(
    name: str, seed: int, number: int, episodes: int, num_threads: int | None
) -> NDArray[np.int64]:
    """Of a script; all policies are measured beside the same."""
    scenario = unseen_teams(seed)[number].scenario
    policy = scripted_policy(name, scenario, seed)
    return _rescues(policy, scenario, seed, episodes, num_threads)


def _rescues(
    policy: Policy, scenario: Scenario, seed: int, episodes: int, num_threads: int | None
) -> NDArray[np.int64]:
    """Rescues of each episode."""
    record = run_episodes(policy, scenario, episodes, seed, num_threads=num_threads)
    return record.rescue_counts()
