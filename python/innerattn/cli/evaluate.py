"""`innerattn evaluate`: measures a trained or scripted policy; shows or writes the results."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro
from rich.console import Console

from innerattn.cli.options import Command, check_target
from innerattn.cli.progress import Evaluating
from innerattn.config import EvaluateConfig, Scenario
from innerattn.config.files import write_whole
from innerattn.errors import RunError
from innerattn.report.tables.evaluation import print_summary

if TYPE_CHECKING:
    from innerattn.evaluate import Evaluation


@dataclass(kw_only=True)
class Evaluate(Command):
    """Measure a trained or scripted policy."""

    policy: Annotated[tyro.conf.Positional[str], tyro.conf.arg(metavar="RUN|POLICY")]
    """A run's folder, or one of random, greedy, hungarian."""
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
            Console(markup=False, highlight=False),
            evaluation.summary,
            evaluation.records[0].scenario,
        )
        if self.json is not None:
            write_whole(self.json, f"{document}\n".encode())
        return 0

    def _measure(self) -> Evaluation:
        from innerattn.evaluate import SCRIPTED, evaluate_policy, evaluate_run, scripted_policy
        from innerattn.records.run_folder import read_config

        if self.policy in SCRIPTED:
            scenario = self._worlds(Scenario.preset("mixed"))
            settings = self._settings(EvaluateConfig())
            chosen = scripted_policy(self.policy, scenario, settings.seed)
            with Evaluating() as progress:
                return evaluate_policy(chosen, scenario, settings, progress=progress)
        if not Path(self.policy).exists():
            raise RunError(
                f"{self.policy}: neither a run's folder nor one of {', '.join(SCRIPTED)}"
            )
        config = read_config(self.policy)
        scenario, settings = self._worlds(config.scenario), self._settings(config.evaluate)
        with Evaluating() as progress:
            return evaluate_run(
                self.policy, scenario=scenario, settings=settings, progress=progress
            )

    def _worlds(self, scenario: Scenario) -> Scenario:
        given = self._given("situation", "episode_steps")
        if self.scenario is not None:
            return Scenario.from_toml(self.scenario, **given)
        return scenario.replace(**given)

    def _settings(self, settings: EvaluateConfig) -> EvaluateConfig:
        names = ("episodes", "score_episodes", "long_episodes", "long_episode_steps", "seed")
        return settings.replace(**self._given(*names))

    def _given(self, *names: str) -> dict[str, object]:
        """The options among ``names`` that were given."""
        values = {name: getattr(self, name) for name in names}
        return {name: value for name, value in values.items() if value is not None}
