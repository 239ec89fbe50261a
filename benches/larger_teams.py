"""What policies that were trained in teams of 3 and 4 robots do in teams of 12.

`python benches/larger_teams.py` trains three seeds by rewards alone and fills a table in
`docs/teams.md`: eight teams of 12 robots that no training met, with the scores of `greedy` and of
the policies. Runs that are done are kept in the folder given by --runs.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from statistics import mean

import tomli_w
from page import machine, publish, table
from specialists import SEEDS, options, trained_side_by_side

from innerattn.config import Scenario
from innerattn.config.family import Family
from innerattn.config.files import write_whole
from innerattn.evaluate import load_trained, run_episodes
from innerattn.evaluate.unseen_teams import EPISODE_STEPS, SEED
from innerattn.policies import Policy, scripted_policy

PAGE = Path(__file__).parents[1] / "docs" / "teams.md"
HEAD = ["team", "`greedy`", *(f"seed {seed}" for seed in SEEDS), "mean"]
SMALL, LARGE, TEAMS = (3, 4), 12, 8
_FIRST = 500
"""Numbers of draws from here on belong to no other table."""


def main() -> None:
    """Train what is missing, measure, and fill the page."""
    given = options(__doc__)
    given.runs.mkdir(parents=True, exist_ok=True)

    family = given.runs / "small-teams.toml"
    write_whole(family, tomli_w.dumps({"family": {"robots": SMALL}}).encode())
    runs = [given.runs / f"small-s{seed}" for seed in SEEDS]
    jobs = [
        (run, ["--family", str(family), "--seed", str(seed)])
        for run, seed in zip(runs, SEEDS, strict=True)
    ]
    trained_side_by_side(jobs, given.env_steps, given.at_once)
    rows, found = [], []
    for number, team in enumerate(large_teams()):
        policies = [
            scripted_policy("greedy", team, SEED),
            *(load_trained(run, team)[1] for run in runs),
        ]
        greedy, *own = scores(policies, team, given.episodes)
        found.append([greedy, *own, mean(own)])
        tasks = "one task" if len(team.tasks) == 1 else f"{len(team.tasks)} tasks"
        rows.append([f"{number + 1}: {tasks}", *(f"{one:.2f}" for one in found[-1])])
    for name, of in (("mean", mean), ("worst", min)):
        rows.append([f"**{name}**", *(f"{of(each):.2f}" for each in zip(*found, strict=True))])
    told = (
        f"{machine('torch')}. {given.env_steps:,} env-steps, {given.episodes} episodes of "
        f"{EPISODE_STEPS} steps each; 0 rescues "
        "as many as `random`, 1 as many as `hungarian`."
    )
    publish("larger_teams", f"{table(HEAD, rows)}\n\n{told}", PAGE)


def large_teams() -> list[Scenario]:
    """Teams of 12 robots."""
    family = Family(robots=(LARGE, LARGE), unavailable=0.0, service=0.0, deadline=0.0, order=0.0)
    base = Scenario(episode_steps=EPISODE_STEPS)
    return [family.draw(SEED, number, base) for number in range(_FIRST, _FIRST + TEAMS)]


def scores(policies: Sequence[Policy], team: Scenario, episodes: int) -> list[float]:
    """Scores of policies in the same worlds: 0 as `random`, 1 as `hungarian`."""
    scripts = [scripted_policy(name, team, SEED) for name in ("random", "hungarian")]
    least, most, *found = (
        float(run_episodes(one, team, episodes, SEED).rescue_counts().mean())
        for one in (*scripts, *policies)
    )
    return [(one - least) / (most - least) for one in found]


if __name__ == "__main__":
    main()
