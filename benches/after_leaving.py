"""What one policy for any team does after a robot left, beside a specialist for those who stay.

`python benches/after_leaving.py` fills a table in `docs/teams.md`: four teams of the family `any`
that no training met. One robot leaves each at half time; those that stay can do all tasks. Up to
then `zoo:any` acts in all worlds. From then on it goes on, or a specialist takes over that was
trained by rewards alone in worlds of those that stay, or the script `hungarian`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from page import machine, publish, table
from specialists import options, trained_side_by_side, write_scenario

from innerattn.config import Scenario
from innerattn.config.family import Family
from innerattn.errors import ConfigError
from innerattn.evaluate import load_trained, run_episodes
from innerattn.evaluate.unseen_teams import EPISODE_STEPS, SEED
from innerattn.policies import Policy, PolicyInput, scripted_policy
from innerattn.report.tables.text import plus_minus
from innerattn.stats.bootstrap import mean_interval

PAGE = Path(__file__).parents[1] / "docs" / "teams.md"
HEAD = ["team of", "`hungarian`", "specialist", "`zoo:any`", "`zoo:any` / specialist"]
HALF = EPISODE_STEPS // 2
TEAMS = 4
_FIRST = 400
"""Numbers of draws from here on belong to none of the 24 unseen teams."""


@dataclass
class TakingOver:
    """A policy that hands all robots over to another at half time.

    Attributes:
        before: acts at first.
        after: acts from half time on.
    """

    before: Policy
    after: Policy
    name: str = "taking-over"
    needs_true_state: bool = True

    def act(self, view: PolicyInput) -> NDArray[np.int64]:
        """See `Policy.act`."""
        late = view.known_state.step_counts >= HALF
        return np.where(late[:, None], self.after.act(view), self.before.act(view))

    def reset(self, seed: int) -> None:
        """See `Policy.reset`."""
        self.before.reset(seed)
        self.after.reset(seed)


def main() -> None:
    """Train what is missing, measure, and fill the page."""
    given = options(__doc__)

    teams = list(losing_teams(TEAMS))
    runs = [given.runs / f"left-{number}" for number in range(len(teams))]
    jobs = [
        (run, ["--scenario", str(write_scenario(run, staying(team))), "--seed", "0"])
        for run, team in zip(runs, teams, strict=True)
    ]
    trained_side_by_side(jobs, given.env_steps, given.at_once)
    rows, shares = [], []
    for run, team in zip(runs, teams, strict=True):
        afterwards = (
            scripted_policy("hungarian", team),
            load_trained(run, team)[1],
            load_trained("zoo:any", team)[1],
        )
        policies = [TakingOver(load_trained("zoo:any", team)[1], one) for one in afterwards]
        found = [late_rescues(one, team, given.episodes) for one in policies]
        told = [mean_interval(one, SEED) for one in found]
        shares.append(told[-1].mean / told[-2].mean)
        cells = [plus_minus(one) for one in told]
        rows.append([f"{len(team.robots)} robots", *cells, f"{shares[-1]:.2f}"])
    text = (
        f"Rescues in the {HALF} steps after a robot left. {machine('torch')}. One specialist a "
        f"team, {given.env_steps:,} env-steps, {given.episodes} episodes, the same worlds "
        "for all; ± is half the 95 % interval."
    )
    publish("after_leaving", f"{table(HEAD, rows)}\n\n{text}", PAGE)


def losing_teams(count: int) -> Iterator[Scenario]:
    """The first draws whose tasks can be done without their first robot, which leaves."""
    family = Family(robots=(5, 8), unavailable=0.0, service=0.0, deadline=0.0, order=0.0)
    number = _FIRST
    while count:
        drawn = family.draw(SEED, number, Scenario(episode_steps=EPISODE_STEPS))
        number += 1
        try:
            staying(drawn)
        except ConfigError:
            continue
        count -= 1
        leaver = drawn.robots[0].name
        fault = {"robot": leaver, "kind": "unavailable", "value": 1.0, "onset_step": HALF}
        yield drawn.replace(faults=[fault])


def staying(team: Scenario) -> Scenario:
    """The worlds of those that stay.

    Raises:
        ConfigError: they cannot do all tasks.
    """
    return team.replace(robots=team.robots[1:], faults=[])


def late_rescues(policy: Policy, team: Scenario, episodes: int) -> NDArray[np.int64]:
    """Rescues (episodes,) of a policy from half time on."""
    record = run_episodes(policy, team, episodes, SEED)
    late = record.rescues[record.rescues["step"] >= HALF]
    return np.bincount(late["episode"], minlength=episodes)


if __name__ == "__main__":
    main()
