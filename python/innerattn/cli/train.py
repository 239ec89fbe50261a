"""`innerattn train`: configuration from options, training with progress, evaluation at the end."""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, make_dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, TypeAlias

import tyro
from rich.console import Console

from innerattn.cli.options import Command, changed, run_options
from innerattn.cli.progress import Evaluating, Training
from innerattn.cli.tables import print_summary
from innerattn.config import BUDGETS, SCENARIOS, RunConfig, load_run_config
from innerattn.config.run import Method

if TYPE_CHECKING:
    Preset: TypeAlias = str
    Budget: TypeAlias = str
else:
    Preset, Budget = Literal[SCENARIOS], Literal[BUDGETS]


@dataclass(kw_only=True)
class _Sources(Command):
    """Where the values of a run come from; later ones win, single options win over all."""

    preset: Preset = "mixed"
    """Built-in scenario."""
    budget: Budget = "quick"
    """Built-in budget: how long to train, and with which numbers."""
    config: Path | None = None
    """TOML file with any of the keys below, in sections; wins over preset and budget. Robots, tasks
    and obstacles are set only there."""

    def load(self, overrides: dict[str, object]) -> RunConfig:
        """The configuration, with single values on top."""
        return load_run_config(
            self.preset, budget=self.budget, config_file=self.config, overrides=overrides
        )


@dataclass(kw_only=True)
class _Choice(_Sources):
    """The options that the defaults of all others depend on."""

    method: Annotated[Method | None, tyro.conf.arg(aliases=["--train.method"])] = None

    def defaults(self) -> RunConfig:
        return self.load({} if self.method is None else {"train.method": self.method})


@dataclass(kw_only=True)
class _Train(_Sources):
    """Train a team, then measure it against scripted teams."""

    defaults: ClassVar[RunConfig]

    run_dir: Path | None = None
    """Folder to make for the run; None: runs/PRESET-METHOD-BUDGET-sSEED-TIME."""

    def run(self) -> None:
        """Train, evaluate and print.

        Raises:
            InnerattnError: wrong configuration, or the run's folder exists.
            KeyboardInterrupt: the user stopped it; what was learnt is saved.
        """
        from innerattn.evaluate import evaluate_run
        from innerattn.train import train

        method = {"train.method": self.defaults.train.method}
        config = self.load(method | changed(self, self.defaults))
        run_dir = self.run_dir or self._new_run_dir(config)
        console = Console(markup=False, highlight=False)
        console.print(
            f"Training {config.train.method} on {config.scenario.situation}: "
            f"{config.train.env_steps:,} env-steps in {config.train.num_envs} worlds, "
            f"seed {config.train.seed}",
        )
        console.print(f"Run folder: {run_dir}", soft_wrap=True)
        try:
            with Training() as progress:
                train(config, run_dir, progress=progress)
        except KeyboardInterrupt:
            if run_dir.is_dir():
                print(f"innerattn: what was learnt is kept in {run_dir}", file=sys.stderr)
            raise
        with Evaluating() as progress:
            evaluation = evaluate_run(run_dir, progress=progress)
        evaluation.write(run_dir / "evaluation")
        print_summary(console, evaluation.summary, config.scenario)
        console.print(f"Measure it again with: innerattn evaluate {run_dir}", soft_wrap=True)

    def _new_run_dir(self, config: RunConfig) -> Path:
        train, stamp = config.train, time.strftime("%Y%m%d-%H%M%S")
        name = f"{config.scenario.situation}-{train.method}-{self.budget}-s{train.seed}-{stamp}"
        return Path("runs") / name


def command_type(argv: Sequence[str]) -> Any:
    """The train command's options; their defaults depend on what ``argv`` chooses.

    Raises:
        ConfigError: the chosen sources make no valid configuration.
    """
    known = [argument for argument in argv if argument not in ("-h", "--help")]
    choice, _ = tyro.cli(_Choice, args=known, prog="innerattn train", return_unknown_args=True)
    defaults = choice.defaults()
    options: list[Any] = run_options(defaults)
    train: Any = make_dataclass("Train", options, bases=(_Train,), kw_only=True)
    train.__doc__ = _Train.__doc__
    train.defaults = defaults
    return train
