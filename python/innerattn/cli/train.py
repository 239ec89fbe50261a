"""`innerattn train`: configuration from options, training with progress, evaluation at the end."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, make_dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, TypeAlias

import tyro
from rich.console import Console

from innerattn.cli.options import LongCommand, UsageError, changed, run_options
from innerattn.cli.progress import Evaluating, SeveralRuns, Training
from innerattn.cli.replay import write_replay
from innerattn.cli.runs import existing_run
from innerattn.cli.seeds import parse_seeds
from innerattn.cli.streams import droppable_output
from innerattn.cli.usage import parse, words_of
from innerattn.config import BUDGETS, SCENARIOS, RunConfig, load_run_config
from innerattn.config.registry import methods
from innerattn.config.sections import WarmStart
from innerattn.cores import usable_cores
from innerattn.errors import ConfigError, RunError
from innerattn.experiments.processes import run_side_by_side
from innerattn.experiments.side_by_side import (
    Run,
    refuse_what_cannot_run,
    say_not_logged,
)
from innerattn.loggers import LOGGERS, Opened, RunLoggers
from innerattn.records.logged import METRICS, logged_lines, logged_rescues, still_rises
from innerattn.report.tables.evaluation import (
    print_seeds,
    print_summary,
    result_line,
    seeds_line,
)
from innerattn.signals import leave, requests_handled_by
from innerattn.zoo import in_zoo

if TYPE_CHECKING:
    Preset: TypeAlias = str
    Budget: TypeAlias = str
    Method: TypeAlias = str
    LoggerName: TypeAlias = str
    from innerattn.train import Progress
else:
    Preset, Budget, Method = Literal[SCENARIOS], Literal[BUDGETS], Literal[tuple(methods())]
    LoggerName = Literal[tuple(LOGGERS)]


@dataclass(kw_only=True)
class _Sources(LongCommand):
    """Where the values of a run come from; later ones win, single options win over all."""

    preset: Preset = "mixed"
    """Built-in scenario."""
    scenario_file: Annotated[Path | None, tyro.conf.arg(name="scenario")] = None
    """TOML file with a scenario of your own, instead of --preset."""
    family_file: Annotated[str | None, tyro.conf.arg(name="family", metavar="any|FILE")] = None
    """Train one policy for many teams: any, the built-in family, or a TOML file with ranges. The
    scenario says the rest, and where the policy is measured."""
    budget: Budget = "quick"
    """Built-in budget: how long to train, and with which numbers."""
    config: Path | None = None
    """TOML file with any of the keys below, in sections; wins over preset and budget. Robots,
    tasks, obstacles and faults are set only there."""

    def load(self, overrides: dict[str, object]) -> RunConfig:
        """The configuration, with single values on top.

        Raises:
            ConfigError: a file cannot be read, or is wrong.
            UsageError: a single value is wrong.
        """
        try:
            return self._load(overrides)
        except ConfigError as error:
            self._load({})  # where a file is wrong by itself, it is no wrong usage
            raise UsageError(str(error)) from error

    def _load(self, overrides: dict[str, object]) -> RunConfig:
        if self.family_file is not None:
            overrides = {"train.method": "team-inner"} | overrides
        return load_run_config(
            self.preset,
            budget=self.budget,
            config_file=self.config,
            overrides=overrides,
            scenario_file=self.scenario_file,
            family=self.family_file,
        )


@dataclass(kw_only=True)
class _Choice(_Sources):
    """The options that must be known before all others, which take their defaults from them."""

    method: Annotated[Method | None, tyro.conf.arg(aliases=["--train.method"])] = None
    warm_start: Annotated[WarmStart | None, tyro.conf.arg(aliases=["--train.warm-start"])] = None
    seed: Annotated[int | None, tyro.conf.arg(aliases=["--train.seed"])] = None
    seeds: str | None = None

    def defaults(self) -> RunConfig:
        if self.seed is not None and self.seeds is not None:
            raise UsageError(f"--seed {self.seed}, --seeds {self.seeds}: must be one of the two")
        chosen = {"train.method": self.method, "train.warm_start": self.warm_start}
        found = self.load({key: value for key, value in chosen.items() if value is not None})
        return found if self.seeds is not None else _with_workers(found)


_WITH_RESUME = ("--resume", "--log", "--debug", "--quiet")


@dataclass(kw_only=True)
class _Train(_Sources):
    """Train a team, then measure it against scripted teams."""

    defaults: ClassVar[RunConfig]

    given: ClassVar[Sequence[str]] = ()

    resume: Annotated[str | None, tyro.conf.arg(metavar="RUN")] = None
    """Go on with a run that was stopped, from its newest checkpoint, as if it had not been; all
    other options are those of the run."""
    run_dir: Path | None = None
    """Folder to make for the run; with --seeds one for each, RUN_DIR-s0, RUN_DIR-s1, ...; None:
    runs/SITUATION-METHOD[-from-SCRIPT]-BUDGET-sSEED-TIME, where a scenario's file gives its name
    for SITUATION."""
    seeds: str | None = None
    """Train one run per seed, instead of --seed: 0..4 (both ends), 0,3,7 or 0..2,7.
    As many go side by side as there are cores, with one thread each unless --train.threads is
    given."""
    log: tuple[LoggerName, ...] = ()
    """Send metrics to these too: tensorboard (event files in the run folder), wandb, mlflow,
    trackio. Needs pip install 'innerattn[log]'."""

    def run(self) -> int:
        """Train, evaluate and print.

        Returns:
            The exit code: 0, or 1 where some of several runs failed.

        Raises:
            InnerattnError: wrong configuration, or a run's folder exists.
            KeyboardInterrupt: the user stopped it; what was learnt is saved.
        """
        with droppable_output():
            return self._run()

    def _run(self) -> int:
        if self.resume is not None:
            given = [w.partition("=")[0] for w in words_of(self.given) if w.startswith("--")]
            others = [option for option in given if option not in _WITH_RESUME]
            if others:
                raise UsageError(
                    f"--resume {self.resume}: the run has its own configuration; leave out "
                    f"{others[0]}"
                )
            return self._resume(self.console(), existing_run(self.resume))
        console = self.console()
        if self.seeds is None:
            return self._train_one(console, self.single_run())
        overrides, seeds = self._overrides(), parse_seeds(self.seeds)
        threads = self.load(overrides).train.threads or 1
        configs = [
            self.load(overrides | {"train.seed": seed, "train.threads": threads}) for seed in seeds
        ]
        return self._train_several(console, configs)

    def single_run(self) -> RunConfig:
        """The configuration of the run that these options make; its workers may be "auto".

        Raises:
            ConfigError: a file cannot be read, or is wrong.
            UsageError: a single value is wrong.
        """
        return _with_workers(self.load(self._overrides()))

    def _overrides(self) -> dict[str, object]:
        train = self.defaults.train
        chosen: dict[str, object] = {
            "train.method": train.method,
            "train.warm_start": train.warm_start,
        }
        return chosen | changed(self, self.defaults)

    def _train_one(self, console: Console, config: RunConfig) -> int:
        with requests_handled_by(leave):
            from innerattn.train import train
            from innerattn.train.workers.choose import with_number_of_workers
            from innerattn.train.workers.torchrun import is_other_worker

        config = with_number_of_workers(config)
        run_dir = self.run_dir or self._new_run_dir(config, _stamp())
        if is_other_worker():
            train(config, run_dir)
            return 0
        refuse_what_cannot_run([Run(config, run_dir)])
        console.print(f"{_what(config)}, seed {config.train.seed}")
        console.print(f"Run folder: {run_dir}", soft_wrap=True)
        return self._finish(
            console, config, run_dir, lambda report: train(config, run_dir, progress=report)
        )

    def _resume(self, console: Console, run_dir: Path) -> int:
        if in_zoo(run_dir):
            raise RunError(f"{self.resume}: a team of the package is done, nothing to go on from")
        with requests_handled_by(leave):
            from innerattn.records.run_folder import read_config, read_info
            from innerattn.train import newest_checkpoint, resume
            from innerattn.train.saved import nothing_was_saved
            from innerattn.train.workers.torchrun import is_other_worker

        if is_other_worker():
            resume(run_dir)
            return 0
        config, info = read_config(run_dir), read_info(run_dir)
        measured = (run_dir / "evaluation" / "summary.json").exists()
        if info.state == "done" and not measured:
            return self._finish(console, config, run_dir, lambda _: None)
        newest = newest_checkpoint(run_dir)
        if newest is not None and info.state != "done":
            console.print(f"Going on with {run_dir} from env-step {newest:,}", soft_wrap=True)
        elif nothing_was_saved(run_dir, info):
            what = "was stopped before its first checkpoint; it begins anew"
            console.print(f"{run_dir} {what}", soft_wrap=True)
        return self._finish(
            console, config, run_dir, lambda report: resume(run_dir, progress=report)
        )

    def _finish(
        self,
        console: Console,
        config: RunConfig,
        run_dir: Path,
        learn: Callable[[Callable[[Progress], None]], object],
    ) -> int:
        """Learn what is left, measure, and print."""
        from innerattn.evaluate import evaluate_run
        from innerattn.evaluate.training_score import scripted_rescues

        # Scripts play one team; what a family's teams rescue has no one score.
        scripts = partial(scripted_rescues, config) if config.family is None else None
        with RunLoggers(self.log, Opened(run_dir, config), failed=say_not_logged) as loggers:
            try:
                with Training(self.progress_console(), scripts=scripts, config=config) as progress:
                    learn(_both(progress, loggers))
            except KeyboardInterrupt:
                _say_what_is_kept([run_dir])
                raise
            with Evaluating(self.progress_console()) as evaluating:
                evaluation = evaluate_run(run_dir, progress=evaluating)
            evaluation.write(run_dir / "evaluation")
            loggers.log_scores(evaluation.summary)
        _say_if_nothing_was_learnt([run_dir])
        print_summary(console, evaluation.summary, config.scenario)
        console.print(f"Measure it again with: innerattn evaluate {run_dir}", soft_wrap=True)
        console.print(f"Watch it in a browser: {write_replay(run_dir)}", soft_wrap=True)
        if _still_rises(run_dir, config):
            more = f"--train.env-steps {2 * config.train.env_steps}"
            console.print(f"Rescues still rose at the end: train longer with {more}")
        console.print(result_line(evaluation.summary), style="bold", soft_wrap=True)
        self.say_result(f"{run_dir}: {result_line(evaluation.summary)}")
        return 0

    def _train_several(self, console: Console, configs: Sequence[RunConfig]) -> int:
        from innerattn.experiments.score_means import seed_scores

        stamp = _stamp()
        runs = [Run(one, self._folder_of_seed(one, stamp), log=self.log) for one in configs]
        refuse_what_cannot_run(runs)
        workers = configs[0].train.workers
        cores = (configs[0].train.threads or 1) * (1 if workers == "auto" else workers)
        at_once = max(1, min(usable_cores() // cores, len(runs)))
        console.print(f"{_what(configs[0])}, {len(runs)} seeds, {at_once} at a time")
        console.print(f"Run folders: {runs[0].folder} to {runs[-1].folder}", soft_wrap=True)
        try:
            with SeveralRuns(self.progress_console()) as progress:
                run_side_by_side(runs, at_once, changed=progress, failed=_say_why, debug=self.debug)
        except KeyboardInterrupt:
            _say_what_is_kept([run.folder for run in runs])
            raise
        _say_if_nothing_was_learnt([run.folder for run in runs if run.state == "done"])
        scores = seed_scores({run.config.train.seed: run.summary for run in runs})
        print_seeds(console, scores)
        console.print("Run folders", style="bold")
        for run in runs:
            console.print(f"  {run.folder} ({run.state})", soft_wrap=True)
        done = [run for run in runs if run.state == "done"]
        rising = sum(_still_rises(run.folder, run.config) for run in done)
        if rising:
            more = f"--train.env-steps {2 * configs[0].train.env_steps}"
            count = f"{rising} of {len(done)} runs"
            console.print(f"Rescues still rose in {count}: train longer with {more}")
        if scores is not None:
            console.print(seeds_line(scores), style="bold", soft_wrap=True)
            folders = f"{runs[0].folder} to {runs[-1].folder}"
            self.say_result(f"{folders}: {seeds_line(scores)}")
        return int(any(run.failure for run in runs))

    def _folder_of_seed(self, config: RunConfig, stamp: str) -> Path:
        if self.run_dir is None:
            return self._new_run_dir(config, stamp)
        if not self.run_dir.name:
            raise UsageError(f"--run-dir {self.run_dir}: must end in a name")
        return Path(f"{self.run_dir}-s{config.train.seed}")

    def _new_run_dir(self, config: RunConfig, stamp: str) -> Path:
        train = config.train
        warm = "" if train.warm_start == "none" else f"-from-{train.warm_start}"
        worlds = self.scenario_file.stem if self.scenario_file else config.scenario.situation
        worlds = Path(self.family_file).stem if self.family_file else worlds
        name = f"{worlds}-{train.method}{warm}-{self.budget}"
        return Path("runs") / f"{name}-s{train.seed}-{stamp}"


def _stamp() -> str:
    return time.strftime("%Y%m%d-%H%M%S")


def _with_workers(config: RunConfig) -> RunConfig:
    """A single training with as many workers as pay, where nobody says how many."""
    if "workers" in config.train.model_fields_set:
        return config
    return config.replace(train=config.train.replace(workers="auto"))


def _what(config: RunConfig) -> str:
    train, first = config.train, ""
    workers = "" if train.workers == 1 else f", {train.workers} workers"
    if train.warm_start != "none":
        first = f"Imitating {train.warm_start} first: {config.imitation.env_steps:,} env-steps\n"
    where = config.scenario.situation if config.family is None else "a family of teams"
    if train.env_steps == 0:
        return f"{first}Training {train.method} on {where}: imitation alone"
    return (
        f"{first}Training {train.method} on {where}: "
        f"{train.env_steps:,} env-steps in {train.num_envs} worlds{workers}"
    )


def _both(
    first: Callable[[Progress], None], second: Callable[[Progress], None]
) -> Callable[[Progress], None]:
    def report(progress: Progress) -> None:
        first(progress)
        second(progress)

    return report


def _say_why(run: Run) -> None:
    print(f"innerattn: error: seed {run.config.train.seed}: {run.failure}", file=sys.stderr)


def _say_what_is_kept(folders: Sequence[Path]) -> None:
    for folder in folders:
        if (folder / "checkpoints" / "latest").exists():
            print(
                f"innerattn: what was learnt is kept in {folder}; go on with: "
                f"innerattn train --resume {folder}",
                file=sys.stderr,
            )


def _still_rises(run_dir: Path, config: RunConfig) -> bool:
    """Whether the course of a finished training has not come to its end."""
    first = config.imitation.env_steps if config.train.warm_start != "none" else 0
    lines = logged_lines((run_dir / METRICS).read_bytes())
    course = [logged_rescues(config, line) for line in lines if line["env_steps"] > first]
    return still_rises([value for value in course if value is not None])


def _say_if_nothing_was_learnt(folders: Sequence[Path]) -> None:
    from innerattn.records.run_folder import read_info

    for folder in folders:
        info = read_info(folder)
        if not info.updates:
            print(
                f"innerattn: warning: {folder}: {info.env_steps:,} env-steps are too few for one "
                "update; nothing was learnt from rewards",
                file=sys.stderr,
            )


def command_type(argv: Sequence[str]) -> Any:
    """The train command's options; their defaults depend on what ``argv`` chooses.

    Raises:
        ConfigError: the chosen sources make no valid configuration.
        UsageError: both --seed and --seeds are given.
    """
    known = [argument for argument in argv if argument not in ("-h", "--help", "--help-all")]
    choice: _Choice = parse(_Choice, known, "innerattn train", all_known=False)
    defaults = choice.defaults()
    options: list[Any] = run_options(defaults)
    train: Any = make_dataclass("Train", options, bases=(_Train,), kw_only=True)
    train.__doc__ = _Train.__doc__
    train.defaults = defaults
    train.given = tuple(argv)
    return train
