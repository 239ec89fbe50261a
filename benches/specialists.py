"""What one policy for any team loses beside a specialist, which was trained for one team alone.

`python benches/specialists.py` fills a table in `docs/teams.md`: the 24 unseen teams, in each of
them a specialist that was trained there, policies for the family `any` (three seeds) with the same
method, number of env-steps and rewards, and `zoo:any`. All play the same worlds. Runs that are done
are kept in the folder given by --runs, so that it can go on after a stop.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from itertools import repeat
from multiprocessing import get_context
from pathlib import Path
from statistics import mean

import tomli_w
from page import machine, publish, table

from innerattn.config import Scenario
from innerattn.config.files import write_whole
from innerattn.evaluate import load_trained
from innerattn.evaluate.unseen_teams import EPISODE_STEPS, scores_in_unseen_teams, unseen_teams
from innerattn.policies import Policy

PAGE = Path(__file__).parents[1] / "docs" / "teams.md"
HEAD = ["team", "robots", "specialist", "any team", "any / specialist", "`zoo:any`"]
SEEDS = (0, 1, 2)
ENV_STEPS = 312_500
"""Of each training: half of the budget `paper`."""
ENOUGH = 0.97
"""The share of a specialist's score that a policy for any team is asked for."""


def main() -> None:
    """Train what is missing, measure, and fill the page."""
    given = options(__doc__)
    teams = unseen_teams()
    of_any = [given.runs / f"any-s{seed}" for seed in SEEDS]
    of_one = [given.runs / f"team-{number:02}" for number in range(len(teams))]
    jobs = [
        *(
            (run, ["--family", "any", "--seed", str(seed)])
            for run, seed in zip(of_any, SEEDS, strict=True)
        ),
        *(
            (run, ["--scenario", str(write_scenario(run, team.scenario)), "--seed", "0"])
            for run, team in zip(of_one, teams, strict=True)
        ),
    ]
    trained_side_by_side(jobs, given.env_steps, given.at_once)

    played = [*([run] * len(teams) for run in of_any), of_one, ["zoo:any"] * len(teams)]
    with ProcessPoolExecutor(given.at_once, get_context("spawn")) as pool:
        *each, specialist, of_zoo = pool.map(scores, played, repeat(given.episodes))
    any_team = [mean(of_team) for of_team in zip(*each, strict=True)]
    rows = []
    for team, *found in zip(teams, specialist, any_team, of_zoo, strict=True):
        size = str(len(team.scenario.robots))
        rows.append([team.told, size, *cells(*found)])
    for name, of in (("mean", mean), ("worst", min)):
        rows.append([f"**{name}**", "", *cells(of(specialist), of(any_team), of(of_zoo))])
    told = (
        f"{enough(any_team, specialist)} of {len(teams)} teams: any team has at least {ENOUGH} of "
        f"the specialist's score; `zoo:any`: {enough(of_zoo, specialist)}. {machine('torch')}. "
        f"One specialist a team, seeds {SEEDS[0]} to {SEEDS[-1]} of any team, "
        f"{given.env_steps:,} env-steps, {given.episodes} episodes of {EPISODE_STEPS} steps each."
    )
    publish("specialists", f"{table(HEAD, rows)}\n\n{told}", PAGE)


def options(told: str | None) -> argparse.Namespace:
    """What was given to a benchmark of trainings: runs, env_steps, episodes, at_once."""
    parser = argparse.ArgumentParser(description=told)
    parser.add_argument("--runs", type=Path, default=Path("runs/specialists"))
    parser.add_argument("--env-steps", type=int, default=ENV_STEPS, help="of each training")
    parser.add_argument("--episodes", type=int, default=500)
    parser.add_argument("--at-once", type=int, default=2, help="processes side by side")
    return parser.parse_args()


def write_scenario(run: Path, scenario: Scenario) -> Path:
    """Write the worlds of a run beside its folder; where they are."""
    run.parent.mkdir(parents=True, exist_ok=True)
    file = run.with_suffix(".toml")
    write_whole(file, tomli_w.dumps(scenario.model_dump(mode="json", exclude_none=True)).encode())
    return file


def trained_side_by_side(
    jobs: Sequence[tuple[Path, Sequence[str]]], env_steps: int, at_once: int
) -> None:
    """Train policies by rewards alone, each on one core, unless they are there already.

    Args:
        jobs: run folders, and words of the command that say what is trained there.
        env_steps: how long.
        at_once: how many side by side.
    """
    with ThreadPoolExecutor(at_once) as pool:
        list(pool.map(lambda job: _train(job[0], env_steps, job[1]), jobs))


def _train(run: Path, env_steps: int, words: Sequence[str]) -> None:
    if (run / "evaluation" / "summary.json").exists():
        return
    options = {
        "--method": "team-inner",
        "--budget": "paper",
        "--train.env-steps": str(env_steps),
        "--train.workers": "1",
        "--train.threads": "1",
        "--evaluate.score-episodes": "50",
        "--evaluate.long-episodes": "10",
        "--evaluate.episodes": "10",
        "--run-dir": str(run),
    }
    pairs = [word for pair in options.items() for word in pair]
    command = [sys.executable, "-m", "innerattn", "train", "--quiet", *pairs, *words]
    subprocess.run(command, check=True)


def scores(runs: Sequence[str | Path], episodes: int) -> list[float]:
    """Scores in the unseen teams, one run for each."""
    left = iter(runs)

    def policy_for(scenario: Scenario) -> Policy:
        return load_trained(next(left), scenario)[1]

    return [found.score for found in scores_in_unseen_teams(policy_for, episodes)]


def cells(specialist: float, any_team: float, of_zoo: float) -> list[str]:
    """A row's numbers."""
    shown = (specialist, any_team, any_team / specialist, of_zoo)
    return [f"{one:.2f}" for one in shown]


def enough(scores: Sequence[float], specialist: Sequence[float]) -> int:
    """In how many teams a policy has `ENOUGH` of the specialist's score."""
    return sum(a >= ENOUGH * b for a, b in zip(scores, specialist, strict=True))


if __name__ == "__main__":
    main()
