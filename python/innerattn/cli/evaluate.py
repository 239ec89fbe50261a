"""`innerattn evaluate`: measures a trained or scripted policy; shows or writes the results."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from innerattn.cli.options import LongCommand, UsageError, check_target, option_values
from innerattn.cli.progress import Evaluating
from innerattn.cli.runs import named_policy
from innerattn.config import EvaluateConfig, Scenario
from innerattn.config.files import write_whole
from innerattn.errors import ConfigError
from innerattn.policies import SCRIPTED
from innerattn.report.tables.evaluation import print_summary, result_line
from innerattn.zoo import in_zoo

if TYPE_CHECKING:
    from innerattn.evaluate import Evaluation


@dataclass(kw_only=True)
class Evaluate(LongCommand):
    """Measure a trained or scripted policy."""

    policy: Annotated[tyro.conf.Positional[str], tyro.conf.arg(metavar="RUN|POLICY")]
    """A run, or one of random, greedy, hungarian. A run is a folder, latest, or the beginning of
    the name of one in runs."""
    scenario: Path | None = None
    """TOML file with the scenario to measure in; None: that of the run, or mixed."""
    situation: Literal["single", "double", "mixed"] | None = None
    """Situation to measure in; None: that of the run, or mixed."""
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
    """Seed of the worlds; None: as the run says, or 12345."""
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
        evaluation = self._measure()
        document = json.dumps(evaluation.summary.to_json(), indent=1, allow_nan=False)
        if self.json == Path("-"):
            print(document)
            return 0
        print_summary(
            self.console(),
            evaluation.summary,
            evaluation.records[0].scenario,
        )
        if self.json is not None:
            write_whole(self.json, f"{document}\n".encode())
        shown = self.policy if in_zoo(self.policy) else named_policy(self.policy, SCRIPTED)
        self.say_result(f"{shown}: {result_line(evaluation.summary)}")
        return 0

    def _measure(self) -> Evaluation:
        from innerattn.evaluate import evaluate_policy, evaluate_run, scripted_policy
        from innerattn.records.run_folder import read_config

        policy = named_policy(self.policy, SCRIPTED)
        if policy in SCRIPTED:
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
