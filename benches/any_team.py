"""What one policy for any team scores in teams that it has never met.

`python benches/any_team.py RUN` fills a table in `docs/teams.md`: 24 teams, each with `greedy`, the
policy and `hungarian` in the same worlds. `--episodes` says how many of each.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from statistics import mean

from page import machine, publish, table

from innerattn.evaluate import load_trained
from innerattn.evaluate.unseen_teams import EPISODE_STEPS, scores_in_unseen_teams

PAGE = Path(__file__).parents[1] / "docs" / "teams.md"
HEAD = ["team", "robots", "greedy", "policy", "hungarian, rescues"]


def main() -> None:
    """Measures and publishes."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("run")
    parser.add_argument("--episodes", type=int, default=500)
    given = parser.parse_args()
    rows, found = [], []
    for one in scores_in_unseen_teams(
        lambda scenario: load_trained(given.run, scenario)[1], given.episodes
    ):
        found.append(one)
        size = str(len(one.team.scenario.robots))
        scores = [f"{one.greedy:.2f}", f"{one.score:.2f}"]
        rows.append([one.team.told, size, *scores, f"{one.most:.2f}"])
        print(*rows[-1], flush=True)
    for name, of in (("mean", mean), ("worst", min)):
        scores = [
            f"{of(each):.2f}" for each in zip(*((x.greedy, x.score) for x in found), strict=True)
        ]
        rows.append([f"**{name}**", "", *scores, ""])
    told = f"{machine()}. {given.episodes} episodes of {EPISODE_STEPS} steps for each policy."
    publish("any_team", f"{table(HEAD, rows)}\n\n{told}", PAGE)


if __name__ == "__main__":
    main()
