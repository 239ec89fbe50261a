"""`innerattn play`: a team that acts live in a browser, and a person who reaches into its world."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from innerattn.cli.options import Command, UsageError, check_seed
from innerattn.cli.runs import named_policy
from innerattn.config import EvaluateConfig, Scenario
from innerattn.policies import SCRIPTS

if TYPE_CHECKING:
    from innerattn.config import RunConfig
    from innerattn.evaluate.interactive import InteractiveWorld
    from innerattn.policies import Policy


@dataclass(kw_only=True)
class Play(Command):
    """Play with a team in a browser on this machine: move, push, break robots; Ctrl-C ends it."""

    policy: Annotated[tyro.conf.Positional[str], tyro.conf.arg(metavar="RUN|POLICY")]
    """A run, or one of random, greedy, hungarian, planner, oracle, greedy-seen; it acts first."""
    scenario: Path | None = None
    """TOML file with the scenario to play in; None: that of the run, or mixed."""
    seed: int | None = None
    """Seed of the world; None: as the run says, or 12345."""
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
        server = LocalServer(play_pages(self._name), self.port, sessions.take)
        greeting = f"Play at {server.address}\nCtrl-C ends it."
        try:
            server.serve(partial(print, greeting, flush=True))
        except KeyboardInterrupt:
            print()
        return 0

    def _check(self) -> None:
        if not 0 <= self.port < 65536:
            raise UsageError(f"--port {self.port}: must be 0 to 65,535")
        check_seed(self.seed, bits=64)
        self.policy = named_policy(self.policy, SCRIPTS)

    @property
    def _name(self) -> str:
        """What to call the team: the script, or the run's folder."""
        if self.policy in SCRIPTS:
            return self.policy
        name = Path(self.policy).resolve().name
        return f"{name} (run)" if name in SCRIPTS else name

    def _world(self) -> InteractiveWorld:
        """A world of its own for a page, with the newest weights of the run."""
        from innerattn.evaluate.interactive import InteractiveWorld, endless
        from innerattn.evaluate.trained import load_trained
        from innerattn.policies import scripted_policy
        from innerattn.records.run_folder import read_config

        config = None if self.policy in SCRIPTS else read_config(self.policy)
        scenario = endless(self._scenario(config))
        settings = EvaluateConfig() if config is None else config.evaluate
        seed = settings.seed if self.seed is None else self.seed
        policies: dict[str, Policy] = {}
        if config is not None:
            # Somebody may blind a robot.
            policies[self._name] = load_trained(self.policy, scenario, each_sees=True)[1]
        others = [name for name in SCRIPTS if name != self.policy]
        for name in [self._name, *others] if config is None else others:
            policies[name] = scripted_policy(name, scenario, seed)
        return InteractiveWorld(scenario, policies, seed)

    def _scenario(self, config: RunConfig | None) -> Scenario:
        if self.scenario is not None:
            return Scenario.from_toml(self.scenario)
        return Scenario.preset("mixed") if config is None else config.scenario
