"""`innerattn page`: a team and its worlds in one file, to play with in any browser."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from innerattn.cli.options import Command, UsageError, check_seed, check_target
from innerattn.cli.runs import named_policy, shown_names
from innerattn.cli.spares import check_spare, spared
from innerattn.config import EvaluateConfig, Scenario
from innerattn.config.files import write_whole
from innerattn.policies import SCRIPTS

if TYPE_CHECKING:
    from innerattn.config import RunConfig
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
    spare: int | None = None
    """Robots of each kind that wait to be added, with a policy for any team or scripts; None: 2, or
    as many as there is room for."""

    def run(self) -> int:
        """Write the file.

        Returns:
            The exit code, 0.

        Raises:
            InnerattnError: no such run, policy or scenario, or a page cannot compute the policy.
            OSError: the file cannot be written.
        """
        self._check()
        from innerattn.records.run_folder import read_config
        from innerattn.report.page.page import worlds_page
        from innerattn.report.page.scripts import page_scripts
        from innerattn.report.page.team import read_team

        names = shown_names(self.policies, SCRIPTS)
        runs = [one for one in self.policies if one not in SCRIPTS]
        config = read_config(runs[0]) if runs else None
        own, settings = self._worlds(config), config.evaluate if config else EvaluateConfig()
        worlds = spared(own, runs, self.spare)
        policies: dict[str, PageTeam | None] = {}
        for name, policy in zip(names, self.policies, strict=True):
            policies[name] = None if policy in SCRIPTS else read_team(policy, worlds)
        seed = settings.seed if self.seed is None else self.seed
        scripts = {one: None for one in page_scripts(worlds) if one not in policies}
        title, beside = " beside ".join(names), names[1] if len(names) > 1 else ""
        page = worlds_page(title, worlds, policies | scripts, seed, beside, own.num_robots)
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
        check_spare(self.spare)
        check_target(self.output)
        self.policies = [named_policy(one, SCRIPTS) for one in self.policies]

    def _worlds(self, config: RunConfig | None) -> Scenario:
        if self.scenario is not None:
            return Scenario.from_toml(self.scenario)
        if self.preset is not None:
            return Scenario.preset(self.preset)
        return Scenario.preset("mixed") if config is None else config.scenario
