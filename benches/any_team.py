"""What one policy for any team scores in teams that it has never met.

`python benches/any_team.py RUN` fills a table in `docs/teams.md`: 24 teams, each with `greedy`, the
policy and `hungarian` in the same worlds. `--episodes` says how many of each.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path
from statistics import mean
from typing import NamedTuple

from page import machine, publish, table

from innerattn.config import Scenario
from innerattn.config.family import Family
from innerattn.evaluate import load_trained, run_episodes, scripted_policy
from innerattn.policies import Policy

PAGE = Path(__file__).parents[1] / "docs" / "teams.md"
SEED = 20_261
"""Of teams and worlds; a training draws its teams from other streams."""
BASE = Scenario(episode_steps=50)
SIZES = (2, 3, 5, 7, 10, 14, 18, 24)
HEAD = ["team", "robots", "greedy", "policy", "hungarian, rescues"]


class Unseen(NamedTuple):
    """A team, and what is unusual about it."""

    group: str
    scenario: Scenario


def teams() -> Iterator[Unseen]:
    """The 24 teams; which they are was fixed before any policy was measured on them."""
    usual = Family(unavailable=0.0)
    for number in range(8):
        yield Unseen("unseen mixture", usual.draw(SEED, number, BASE))
    for number, size in enumerate(SIZES):
        kinds = (min(2, size), min(5, size))
        family = usual.replace(robots=(size, size), kinds=kinds)
        yield Unseen("unseen size", family.draw(SEED, 100 + number, BASE))
    for number, (key, limits) in enumerate(
        (
            ("max_speed_mps", (2.0, 2.6)),
            ("max_speed_mps", (0.3, 0.45)),
            ("mass_kg", (2.0, 4.0)),
            ("mass_kg", (0.2, 0.35)),
        )
    ):
        yield Unseen("unseen bodies", usual.replace(**{key: limits}).draw(SEED, 200 + number, BASE))
    half = BASE.episode_steps // 2
    for number, (group, fault) in enumerate(
        (
            ("one leaves at half time", {"kind": "unavailable", "onset_step": half}),
            ("one joins at half time", {"kind": "unavailable", "duration_steps": half}),
            ("one slows to a quarter", {"kind": "speed_limit", "onset_step": half}),
            ("one leaves at half time", {"kind": "unavailable", "onset_step": half}),
        )
    ):
        scenario = usual.replace(robots=(5, 8)).draw(SEED, 300 + number, BASE)
        value = 0.25 if fault["kind"] == "speed_limit" else 1.0
        changed = {"robot": scenario.robots[0].name, "value": value, **fault}
        yield Unseen(group, scenario.replace(faults=[changed]))


def rescues(policy: Policy, scenario: Scenario, episodes: int) -> float:
    """Mean rescues per episode."""
    return float(run_episodes(policy, scenario, episodes, SEED).rescue_counts().mean())


def main() -> None:
    """Measures and publishes."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("run")
    parser.add_argument("--episodes", type=int, default=500)
    given = parser.parse_args()
    rows, scores = [], []
    for unseen in teams():
        scenario = unseen.scenario
        low, greedy, high = (
            rescues(scripted_policy(name, scenario, SEED), scenario, given.episodes)
            for name in ("random", "greedy", "hungarian")
        )
        own = rescues(load_trained(given.run, scenario)[1], scenario, given.episodes)
        found = [(one - low) / (high - low) for one in (greedy, own)]
        scores.append(found)
        size = str(len(scenario.robots))
        rows.append([unseen.group, size, *(f"{one:.2f}" for one in found), f"{high:.2f}"])
        print(*rows[-1], flush=True)
    greedy_scores, own_scores = zip(*scores, strict=True)
    for name, of in (("mean", mean), ("worst", min)):
        rows.append([f"**{name}**", "", f"{of(greedy_scores):.2f}", f"{of(own_scores):.2f}", ""])
    told = f"{machine()}. {given.episodes} episodes of {BASE.episode_steps} steps for each policy."
    publish("any_team", f"{table(HEAD, rows)}\n\n{told}", PAGE)


if __name__ == "__main__":
    main()
