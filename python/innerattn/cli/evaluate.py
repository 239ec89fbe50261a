"""`innerattn evaluate`: measures a policy or a planner; shows or writes the results."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import tyro

from innerattn.cli.options import (
    LongCommand,
    UsageError,
    check_seed,
    check_target,
    option_values,
)
from innerattn.cli.planners import check_evaluations, check_planner, limit_ms
from innerattn.cli.progress import Evaluating, Planning
from innerattn.cli.runs import named_policy
from innerattn.config import EvaluateConfig, Scenario
from innerattn.config.files import write_whole
from innerattn.config.instances import Instance, WorldInstance, read_any
from innerattn.errors import ConfigError
from innerattn.policies import SCRIPTS
from innerattn.report.table import print_table
from innerattn.report.tables.evaluation import print_summary, result_line
from innerattn.report.tables.instances import (
    results_line,
    results_table,
    worlds_line,
    worlds_table,
)
from innerattn.zoo import in_zoo

if TYPE_CHECKING:
    from innerattn.evaluate import Evaluation

_OF_WORLDS = (
    "scenario",
    "situation",
    "episode_steps",
    "episodes",
    "score_episodes",
    "long_episodes",
    "long_episode_steps",
)
"""Options that have no meaning for instances."""
_OF_POINTS = ("time_limit_ms", "evaluations", "engine")
"""Options that have a meaning for instances of points alone."""


@dataclass(kw_only=True)
class Evaluate(LongCommand):
    """Measure a trained or scripted policy, or a planner on instances."""

    policy: Annotated[tyro.conf.Positional[str], tyro.conf.arg(metavar="RUN|POLICY")]
    """A run, or one of random, greedy, hungarian, planner, oracle, greedy-seen. A run is a folder,
    latest, or the beginning of the name of one in runs. With --instances ral: planner, learnt,
    guided, greedy or random; learnt:FILE and guided:FILE use a policy of your own."""
    scenario: Path | None = None
    """TOML file with the scenario to measure in; None: that of the run, or mixed."""
    situation: Literal["single", "double", "mixed", "poisson", "listed"] | None = None
    """Situation to measure in; None: that of the run, or mixed. poisson and listed: where the
    scenario says which victims arrive."""
    episode_steps: int | None = None
    """Length of an episode [control steps]; None: that of the run, or 25."""
    episodes: int | None = None
    """Episodes that cooperation and attention are taken from; None: as the run says, or 80."""
    score_episodes: int | None = None
    """Episodes that rescues are averaged over, at least --episodes; None: as the run says, or
    1000."""
    long_episodes: int | None = None
    """Episodes of the second length; None: as the run says, or 200."""
    long_episode_steps: int | None = None
    """The second length [control steps]; None: as the run says, or 100."""
    seed: int | None = None
    """Seed of the worlds; None: as the run says, or 12345. With --instances, of what is measured;
    None: 0."""
    instances: str | None = None
    """Measure on these instead: a JSON file, or what comes with the package: ral (instances of
    task allocation, for planners) or standard (300 worlds)."""
    time_limit_ms: int | None = None
    """How long planner and guided search for each instance [ms]; None: 1000, or without limit if
    --evaluations is given."""
    evaluations: int | None = None
    """Orders that planner and guided try for each instance; results then do not depend on the speed
    of the machine. None: as many as the time allows."""
    engine: Literal["none", "discs", "rapier"] | None = None
    """With --instances ral: play the schedules in worlds of bodies with these contacts, or none;
    None: exactly, as points."""
    json: Path | None = None
    """Write the results to this file too; - for standard output, and nothing else there."""

    def run(self) -> int:
        """Measure, print, write.

        Returns:
            The exit code, 0.

        Raises:
            InnerattnError: no such run or policy, or wrong options.
            OSError: the results cannot be written.
        """
        if self.json is not None:
            check_target(self.json)
        if self.instances is not None:
            return self._on_instances(self.instances)
        for name in self._given(*_OF_POINTS):
            raise UsageError(f"--{name.replace('_', '-')}: needs --instances")
        evaluation = self._measure()
        if self._wrote(evaluation.summary.to_json()):
            return 0
        print_summary(
            self.console(),
            evaluation.summary,
            evaluation.records[0].scenario,
        )
        shown = self.policy if in_zoo(self.policy) else named_policy(self.policy, SCRIPTS)
        self.say_result(f"{shown}: {result_line(evaluation.summary)}")
        return 0

    def _wrote(self, document: dict[str, Any]) -> bool:
        """Write the results where they shall go. Whether that was standard output."""
        text = json.dumps(document, indent=1, allow_nan=False)
        if self.json == Path("-"):
            print(text)
            return True
        if self.json is not None:
            write_whole(self.json, f"{text}\n".encode())
        return False

    def _on_instances(self, source: str) -> int:
        """Measure on instances of either sort."""
        for name in self._given(*_OF_WORLDS):
            raise UsageError(f"--{name.replace('_', '-')}: has no meaning with --instances")
        check_seed(self.seed)
        instances = read_any(source)
        worlds = [one for one in instances if isinstance(one, WorldInstance)]
        if worlds:
            return self._in_worlds(worlds)
        return self._planned([one for one in instances if isinstance(one, Instance)])

    def _planned(self, instances: Sequence[Instance]) -> int:
        """Measure a planner."""
        from innerattn.evaluate.instances import solve_instances

        check_planner(self.policy, "--instances")
        check_evaluations(self.evaluations)
        has_no_limit = self.time_limit_ms is None and self.evaluations is not None
        limit = None if has_no_limit else limit_ms(self.time_limit_ms)
        with Planning(self.progress_console()) as progress:
            found = solve_instances(
                self.policy,
                instances,
                limit,
                self.seed or 0,
                progress,
                self.engine,
                self.evaluations,
            )
        if self._wrote(found.to_json()):
            return 0
        print_table(self.console(), results_table(found))
        self.say_result(f"{self.policy}: {results_line(found)}")
        return 0

    def _in_worlds(self, worlds: Sequence[WorldInstance]) -> int:
        """Measure a script or a team in worlds."""
        from innerattn.evaluate.instance_worlds import evaluate_worlds

        for name in self._given(*_OF_POINTS):
            raise UsageError(f"--{name.replace('_', '-')}: has no meaning in worlds")
        policy = named_policy(self.policy, SCRIPTS)
        shown = self.policy if in_zoo(self.policy) else policy
        with Planning(self.progress_console()) as progress:
            found = replace(evaluate_worlds(policy, worlds, self.seed or 0, progress), policy=shown)
        if self._wrote(found.to_json()):
            return 0
        print_table(self.console(), worlds_table(found))
        self.say_result(f"{shown}: {worlds_line(found)}")
        return 0

    def _measure(self) -> Evaluation:
        from innerattn.evaluate import evaluate_policy, evaluate_run, scripted_policy
        from innerattn.records.run_folder import read_config

        policy = named_policy(self.policy, SCRIPTS)
        if policy in SCRIPTS:
            scenario = self._worlds(Scenario.preset("mixed"))
            settings = self._settings(EvaluateConfig())
            chosen = scripted_policy(policy, scenario, settings.seed)
            with Evaluating(self.progress_console()) as progress:
                return evaluate_policy(chosen, scenario, settings, progress=progress)
        config = read_config(policy)
        scenario, settings = self._worlds(config.scenario), self._settings(config.evaluate)
        with Evaluating(self.progress_console()) as progress:
            return evaluate_run(policy, scenario=scenario, settings=settings, progress=progress)

    def _worlds(self, scenario: Scenario) -> Scenario:
        """The worlds to measure in.

        Raises:
            UsageError: the options do not fit the scenario, such as a situation in which nobody
                would arrive.
        """
        worlds = self._with_options(scenario)
        if self.situation == "poisson" and not any(one.arrival_rate_hz for one in worlds.tasks):
            raise UsageError(
                "--situation poisson: no task of the scenario has an arrival_rate_hz above 0, so "
                "nobody would arrive; --scenario FILE takes one that has"
            )
        if self.situation == "listed" and not worlds.arrivals:
            raise UsageError(
                "--situation listed: the scenario has no arrivals, so nobody would arrive; "
                "--scenario FILE takes one that has"
            )
        return worlds

    def _with_options(self, scenario: Scenario) -> Scenario:
        given = self._given("situation", "episode_steps")
        if self.scenario is None:
            with option_values():
                return scenario.replace(**given)
        try:
            return Scenario.from_toml(self.scenario, **given)
        except ConfigError as error:
            Scenario.from_toml(self.scenario)  # a file that is wrong by itself is no wrong usage
            raise UsageError(str(error)) from error

    def _settings(self, settings: EvaluateConfig) -> EvaluateConfig:
        names = ("episodes", "score_episodes", "long_episodes", "long_episode_steps", "seed")
        with option_values():
            return settings.replace(**self._given(*names))

    def _given(self, *names: str) -> dict[str, object]:
        """The options among ``names`` that were given."""
        values = {name: getattr(self, name) for name in names}
        return {name: value for name, value in values.items() if value is not None}
