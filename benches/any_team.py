"""What one policy for any team scores in teams that it has never met.

`python benches/any_team.py RUN` fills a table in `docs/teams.md`: 24 teams, each with `greedy`,
`planner`, the policy and `hungarian` in the same worlds. `--episodes` says how many of each.
`--seed 20262` draws 24 other teams of the same groups, and fills the second table.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from statistics import mean

import numpy as np
from numpy.typing import NDArray
from page import machine, publish, table

from innerattn.config import Scenario
from innerattn.evaluate import load_trained
from innerattn.evaluate.unseen_teams import EPISODE_STEPS, SEED, TeamScore, scores_in_unseen_teams
from innerattn.policies import Policy, scripted_policy
from innerattn.stats.comparison import holm
from innerattn.stats.student import difference_p

PAGE = Path(__file__).parents[1] / "docs" / "teams.md"
HEAD = ["team", "robots", "greedy", "planner", "policy", "beside hungarian", "hungarian, rescues"]
LEVEL = 0.05


def main() -> None:
    """Measures and publishes."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("run")
    parser.add_argument("--episodes", type=int, default=500)
    parser.add_argument("--seed", type=int, default=SEED)
    given = parser.parse_args()

    def scores_of(policy_for: Callable[[Scenario], Policy]) -> Iterator[TeamScore]:
        return scores_in_unseen_teams(policy_for, given.episodes, seed=given.seed)

    played = zip(
        scores_of(lambda one: scripted_policy("planner", one)),
        scores_of(lambda one: load_trained(given.run, one)[1]),
        strict=True,
    )
    found = []
    for planner, policy in played:
        scores = (policy.greedy, planner.score, policy.score)
        found.append((policy, scores))
        print(policy.team.told, *(f"{one:.2f}" for one in scores), flush=True)
    beside = besides([policy.more for policy, _ in found])
    rows = []
    for (policy, scores), word in zip(found, beside, strict=True):
        size = str(len(policy.team.scenario.robots))
        cells = [f"{one:.2f}" for one in scores]
        rows.append([policy.team.told, size, *cells, word, f"{policy.most:.2f}"])
    for name, of in (("mean", mean), ("worst", min)):
        cells = [f"{of(each):.2f}" for each in zip(*(scores for _, scores in found), strict=True)]
        rows.append([f"**{name}**", "", *cells, "", ""])
    told = f"{machine()}. {given.episodes} episodes of {EPISODE_STEPS} steps for each policy."
    part = "any_team" if given.seed == SEED else "other_teams"
    publish(part, f"{table(HEAD, rows)}\n\n{told}", PAGE)


def besides(differences: Sequence[NDArray[np.int64]]) -> list[str]:
    """Whether the policy rescues more or fewer than `hungarian`, by paired t-tests and Holm."""
    p_values = [difference_p(one) if one.std() > 0.0 else 1.0 for one in differences]
    return [
        "undecided" if p >= LEVEL else "more" if one.mean() > 0.0 else "fewer"
        for one, p in zip(differences, holm(p_values), strict=True)
    ]


if __name__ == "__main__":
    main()
