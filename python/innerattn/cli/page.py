"""`innerattn page`: a team and its worlds in one file, to play with in any browser."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from innerattn.cli.options import Command, UsageError, check_seed, check_target
from innerattn.cli.runs import named_policy, shown_names
from innerattn.config import EvaluateConfig, Scenario
from innerattn.config.files import write_whole
from innerattn.policies import SCRIPTS

if TYPE_CHECKING:
    from innerattn.report.page.team import PageTeam


@dataclass(kw_only=True)
class Page(Command):
    """Write one HTML file in which a team acts live, to play with: no server and no network."""

    policies: Annotated[tyro.conf.Positional[list[str]], tyro.conf.arg(metavar="RUN|POLICY ...")]
    """Runs, or scripts that a page can compute: random, greedy, hungarian; two are shown side by
    side, in the same world."""
    output: Annotated[Path, tyro.conf.arg(aliases=["-o"])] = Path("page.html")
    """File to write."""
    preset: str | None = None
    """Built-in scenario to play in; None: that of the first run, or mixed."""
    scenario: Path | None = None
    """TOML file with the scenario to play in; None: that of the first run, or mixed."""
    seed: int | None = None
    """Seed of the world; None: as the first run says, or 12345."""

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

        names, worlds = shown_names(self.policies, SCRIPTS), self._worlds()
        policies: dict[str, PageTeam | None] = {}
        settings: EvaluateConfig | None = None
        for name, policy in zip(names, self.policies, strict=True):
            policies[name] = team = None if policy in SCRIPTS else read_team(policy, worlds)
            if team is not None:
                worlds, settings = worlds or team.config.scenario, settings or team.config.evaluate
        worlds, settings = worlds or Scenario.preset("mixed"), settings or EvaluateConfig()
        seed = settings.seed if self.seed is None else self.seed
        scripts = {one: None for one in page_scripts(worlds) if one not in policies}
        title, beside = " beside ".join(names), names[1] if len(names) > 1 else ""
        page = worlds_page(title, worlds, policies | scripts, seed, beside)
        write_whole(self.output, page.encode(errors="backslashreplace"))
        print(f"{self.output}: {title}, {self.output.stat().st_size / 1e6:.1f} MB")
        return 0

    def _check(self) -> None:
        if not 1 <= len(self.policies) <= 2:
            raise UsageError(f"{len(self.policies)} policies: must be 1 or 2 of RUN|POLICY")
        if self.preset is not None and self.scenario is not None:
            raise UsageError("--preset and --scenario: only one of them")
        if self.output.suffix != ".html":
            raise UsageError(f"-o {self.output}: must end in .html")
        check_seed(self.seed)
        check_target(self.output)
        self.policies = [named_policy(one, SCRIPTS) for one in self.policies]

    def _worlds(self) -> Scenario | None:
        if self.scenario is not None:
            return Scenario.from_toml(self.scenario)
        return None if self.preset is None else Scenario.preset(self.preset)
