"""`innerattn page`: a team and its worlds in one file, to play with in any browser."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from innerattn.cli.options import Command, UsageError, check_seed, check_target
from innerattn.cli.runs import named_policy
from innerattn.config import EvaluateConfig, Scenario
from innerattn.config.files import write_whole
from innerattn.policies import SCRIPTS

if TYPE_CHECKING:
    from innerattn.report.page.team import PageTeam


@dataclass(kw_only=True)
class Page(Command):
    """Write one HTML file in which a team acts live, to play with: no server and no network."""

    policy: Annotated[tyro.conf.Positional[str], tyro.conf.arg(metavar="RUN|POLICY")]
    """A run, or a script that a page can compute: random, greedy, hungarian."""
    output: Annotated[Path, tyro.conf.arg(aliases=["-o"])] = Path("page.html")
    """File to write."""
    preset: str | None = None
    """Built-in scenario to play in; None: that of the run, or mixed."""
    scenario: Path | None = None
    """TOML file with the scenario to play in; None: that of the run, or mixed."""
    seed: int | None = None
    """Seed of the world; None: as the run says, or 12345."""

    def run(self) -> int:
        """Write the file.

        Returns:
            The exit code, 0.

        Raises:
            InnerattnError: no such run, policy or scenario, or a page cannot compute the policy.
            OSError: the file cannot be written.
        """
        self._check()
        from innerattn.report.page.page import worlds_page
        from innerattn.report.page.scripts import page_scripts
        from innerattn.report.page.team import read_team

        worlds = self._worlds()
        policies: dict[str, PageTeam | None] = {}
        settings, name = EvaluateConfig(), self.policy
        if self.policy not in SCRIPTS:
            team = read_team(self.policy, worlds)
            worlds, settings = worlds or team.config.scenario, team.config.evaluate
            name = Path(self.policy).resolve().name
            name = f"{name} (run)" if name in SCRIPTS else name
            policies[name] = team
        worlds = worlds or Scenario.preset("mixed")
        scripts = page_scripts(worlds)
        if not policies:
            scripts = tuple(dict.fromkeys([self.policy, *scripts]))
        seed = settings.seed if self.seed is None else self.seed
        page = worlds_page(name, worlds, policies | dict.fromkeys(scripts), seed)
        write_whole(self.output, page.encode(errors="backslashreplace"))
        print(f"{self.output}: {name}, {self.output.stat().st_size / 1e6:.1f} MB")
        return 0

    def _check(self) -> None:
        if self.preset is not None and self.scenario is not None:
            raise UsageError("--preset and --scenario: only one of them")
        if self.output.suffix != ".html":
            raise UsageError(f"-o {self.output}: must end in .html")
        check_seed(self.seed)
        check_target(self.output)
        self.policy = named_policy(self.policy, SCRIPTS)

    def _worlds(self) -> Scenario | None:
        if self.scenario is not None:
            return Scenario.from_toml(self.scenario)
        return None if self.preset is None else Scenario.preset(self.preset)
