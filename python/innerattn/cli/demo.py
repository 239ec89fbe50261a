"""`innerattn demo`: plays a trained team beside two scripts, and shows it in a page; no torch."""

from __future__ import annotations

import os
import sys
import webbrowser
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from innerattn.cli.options import LongCommand, UsageError, check_seed, check_target
from innerattn.config import Scenario
from innerattn.config.files import write_whole
from innerattn.stats import Estimate

TEAM = "zoo:mixed"
_SCRIPTS = ("random", "hungarian")
_RULE = (
    "A victim is rescued when robots that have all it needs (food and medicine, or food and "
    "information) reach it together.",
    "random: any action, each with the same chance",
    "hungarian: robots assigned to victims by arrival time; it sees the true state",
    "± is half the 95 % interval over episodes",
)


@dataclass(kw_only=True)
class Demo(LongCommand):
    """Show worlds and a trained team in seconds: a result, and a page to play with."""

    output: Annotated[Path, tyro.conf.arg(aliases=["-o"])] = Path("demo.html")
    """File to write: what `innerattn page zoo:mixed` writes."""
    no_open: tyro.conf.FlagCreatePairsOff[bool] = False
    """Do not open the page in a browser; where there is no display, none is opened anyway."""
    episodes: int = 1000
    """Episodes that rescues are averaged over."""
    seed: int = 12345
    """Seed of the worlds."""

    def run(self) -> int:
        """Play, print, write the page, open it.

        Returns:
            The exit code, 0.

        Raises:
            UsageError: an option is out of range.
            OSError: the page cannot be written.
        """
        if self.output.suffix != ".html":
            raise UsageError(f"-o {self.output}: must end in .html")
        if not 1 <= self.episodes <= 1_000_000:
            raise UsageError(f"--episodes {self.episodes:,}: must be 1 to 1,000,000")
        check_seed(self.seed)
        check_target(self.output)
        from innerattn.policies.plain_team import read_plain_team

        scenario = read_plain_team(TEAM).config.scenario
        rescues = rescues_of(scenario, self.episodes, self.seed)
        self._print(rescues, scenario)
        self._write_page()
        page = self.output.resolve().as_uri()
        opened = not self.no_open and has_display() and webbrowser.open(page)
        if not self.quiet:
            way = "opened in the browser" if opened else "open it in a browser"
            print(f"{self.output}: the team and its world, to play with; {way}")
            print("To train a team: pip install 'innerattn[train]', then innerattn train")
        return 0

    def _print(self, rescues: Mapping[str, Estimate], scenario: Scenario) -> None:
        from innerattn.report.table import columns, plain_table, print_table
        from innerattn.report.tables.text import plus_minus

        names = {"random": "random", TEAM: f"{TEAM} (trained)", "hungarian": "hungarian"}
        rows = [[shown, plus_minus(rescues[name])] for name, shown in names.items()]
        steps, console = scenario.episode_steps, self.console()
        heads = columns(["policy"], [f"{steps} steps"])
        title = f"Rescues per episode of {scenario.num_robots} robots, {self.episodes:,} episodes"
        console.print()
        print_table(console, plain_table(heads, rows, title, _RULE))
        self.say_result(f"{TEAM}: {plus_minus(rescues[TEAM])} rescues per episode of {steps} steps")

    def _write_page(self) -> None:
        from innerattn.report.page.page import worlds_page
        from innerattn.report.page.scripts import page_scripts
        from innerattn.report.page.team import read_team

        team = read_team(TEAM)
        scenario, name = team.config.scenario, TEAM.partition(":")[2]
        policies = {name: team, **dict.fromkeys(page_scripts(scenario))}
        page = worlds_page(name, scenario, policies, self.seed)
        write_whole(self.output, page.encode(errors="backslashreplace"))


def rescues_of(scenario: Scenario, episodes: int, seed: int) -> dict[str, Estimate]:
    """Rescues per episode of the team and of the scripts, as `innerattn evaluate` measures them.

    Args:
        scenario: the worlds.
        episodes: how many, at least 1.
        seed: of the worlds, 0 to 2**63 - 1.

    Returns:
        By name of the policy; the team's is `TEAM`.
    """
    from innerattn.evaluate import run_episodes, scripted_policy
    from innerattn.policies.plain_team import PlainPolicy, read_plain_team
    from innerattn.stats.bootstrap import mean_interval

    team = PlainPolicy(read_plain_team(TEAM, scenario))
    policies = {TEAM: team} | {name: scripted_policy(name, scenario, seed) for name in _SCRIPTS}
    found = {}
    for name, policy in policies.items():
        record = run_episodes(policy, scenario, episodes, seed)
        found[name] = mean_interval(record.rescue_counts(), seed)
    return found


def has_display() -> bool:
    """Whether a browser would have a window; without one, a text browser may take the terminal."""
    if sys.platform in ("win32", "darwin"):
        return True
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
