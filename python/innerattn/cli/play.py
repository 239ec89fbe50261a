"""`innerattn play`: a team that acts live in a browser, and a person who reaches into its world."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from innerattn.cli.options import Command, UsageError, check_seed
from innerattn.cli.runs import named_policy, shown_names
from innerattn.cli.spares import check_spare, spared
from innerattn.config import EvaluateConfig, Scenario
from innerattn.policies import SCRIPTS

if TYPE_CHECKING:
    from innerattn.config import RunConfig
    from innerattn.evaluate.interactive import InteractiveWorld
    from innerattn.policies import Policy


@dataclass(kw_only=True)
class Play(Command):
    """Play with a team in a browser on this machine: move, push, break robots; Ctrl-C ends it."""

    policies: Annotated[tyro.conf.Positional[list[str]], tyro.conf.arg(metavar="RUN|POLICY ...")]
    """Runs, or random, greedy, hungarian, planner, oracle, greedy-seen; two are shown side by side,
    in the same world. All can take over later."""
    scenario: Path | None = None
    """TOML file with the scenario to play in; None: that of the first run, or mixed."""
    seed: int | None = None
    """Seed of the world; None: as the first run says, or 12345."""
    spare: int | None = None
    """Robots of each kind that wait to be added, with a policy for any team or scripts; None: 2, or
    as many as there is room for."""
    port: int = 0
    """Port of 127.0.0.1; 0: any that is free."""

    def run(self) -> int:
        """Serve until Ctrl-C.

        Returns:
            The exit code, 0.

        Raises:
            InnerattnError: no such run, policy or scenario, or the port is taken.
        """
        self._check()
        from innerattn.report.local_server import LocalServer
        from innerattn.report.play.page import play_pages
        from innerattn.report.play.sessions import Sessions

        self._world()
        sessions = Sessions(self._world)
        names = self._names
        title, beside = " beside ".join(names), names[1] if len(names) > 1 else ""
        server = LocalServer(play_pages(title, beside), self.port, sessions.take)
        greeting = f"Play at {server.address}\nCtrl-C ends it."
        try:
            server.serve(partial(print, greeting, flush=True))
        except KeyboardInterrupt:
            print()
        return 0

    def _check(self) -> None:
        if not 1 <= len(self.policies) <= 2:
            raise UsageError(f"{len(self.policies)} policies: must be 1 or 2 of RUN|POLICY")
        if not 0 <= self.port < 65536:
            raise UsageError(f"--port {self.port}: must be 0 to 65,535")
        check_seed(self.seed, bits=64)
        check_spare(self.spare)
        self.policies = [named_policy(one, SCRIPTS) for one in self.policies]

    @property
    def _names(self) -> list[str]:
        return shown_names(self.policies, SCRIPTS)

    def _world(self) -> InteractiveWorld:
        """A world of its own for an arena of a page, with the newest weights of runs."""
        from innerattn.evaluate.interactive import InteractiveWorld, endless
        from innerattn.evaluate.trained import load_trained
        from innerattn.policies import scripted_policy
        from innerattn.policies.scripted.crew import CrewPolicy
        from innerattn.records.run_folder import read_config

        runs = [one for one in self.policies if one not in SCRIPTS]
        config = read_config(runs[0]) if runs else None
        own = self._scenario(config)
        scenario = endless(spared(own, runs, self.spare))
        settings = EvaluateConfig() if config is None else config.evaluate
        seed = settings.seed if self.seed is None else self.seed
        named = dict(zip(self._names, self.policies, strict=True))
        policies: dict[str, Policy] = {}
        for name, policy in {**named, **{one: one for one in SCRIPTS}}.items():
            if policy in SCRIPTS:
                make = partial(scripted_policy, policy, seed=seed)
                has_spares = scenario.num_robots > own.num_robots
                policies[name] = (
                    CrewPolicy(make, scenario, own.num_robots) if has_spares else make(scenario)
                )
            else:  # somebody may blind a robot
                policies[name] = load_trained(policy, scenario, each_sees=True)[1]
        return InteractiveWorld(scenario, policies, seed, own.num_robots)

    def _scenario(self, config: RunConfig | None) -> Scenario:
        if self.scenario is not None:
            return Scenario.from_toml(self.scenario)
        return Scenario.preset("mixed") if config is None else config.scenario
