"""What `innerattn reproduce` can make: one registry of targets, each with its runs and its report.

Modules that write reports load more than the options of a command need, so each is imported when
its report is written.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, Protocol

from innerattn.experiments.attention.arms import METHODS as ATTENTION_METHODS
from innerattn.experiments.attention.arms import SITUATIONS as ATTENTION_SITUATIONS
from innerattn.experiments.crossed.arms import SITUATIONS as CROSSED_SITUATIONS
from innerattn.experiments.crossed.arms import plan_crossed, plan_swapped
from innerattn.experiments.learning.recipe import plan_ablations
from innerattn.experiments.learning.variants import (
    AFTERSTATES,
    CONTINUOUS,
    ENTITIES,
    LONG,
    WARM_START,
)
from innerattn.experiments.learning.variants import SITUATIONS as LEARNING_SITUATIONS
from innerattn.experiments.plan import METHODS, SITUATIONS, PlannedRun, plan
from innerattn.experiments.robustness.design import plan_robustness

if TYPE_CHECKING:
    from innerattn.experiments.processes import Job
    from innerattn.experiments.run import FinishedRun
    from innerattn.experiments.scan import RunStatus


class PlanRuns(Protocol):
    """Lists the runs that a target needs, such as `innerattn.experiments.plan.plan`."""

    def __call__(
        self,
        methods: Sequence[str],
        situations: Sequence[str],
        seeds: Sequence[int],
        budget: str,
        out: Path,
        overrides: Mapping[str, object] | None = None,
    ) -> list[PlannedRun]:
        """The runs, in the order in which they are trained."""


class WriteReport(Protocol):
    """Writes a report, such as `innerattn.report.crossed.write.write_crossed`."""

    def __call__(
        self, runs: Sequence[FinishedRun], out: Path, budget: str, left_out: Sequence[str]
    ) -> object:
        """Write the files into ``out``; ``left_out`` is what the report says of missing runs."""


class Report(NamedTuple):
    """The files of a report, and what writes them."""

    files: tuple[str, ...]
    write: WriteReport


@dataclass(frozen=True)
class Target:
    """Something to reproduce.

    Attributes:
        name: on the command line.
        shows: what it is, for the command's help.
        plan: lists the runs that it needs.
        report: loads its report.
        methods: those that it has unless some are chosen.
        further: other methods that can be chosen, too.
        situations: those that it has unless others of `SITUATIONS` are chosen.
        study: begins the name of its study's folder, which ends in the budget.
        steps: whether it needs metrics and steps of runs.
        archived: whether archived runs do, which have neither; for "all" they do for the table.
        draws: whether it needs matplotlib.
        jobs: what has to be done with finished runs before the report, and is not done yet; None
            where there is never anything.
    """

    name: str
    shows: str
    plan: PlanRuns
    report: Callable[[], Report]
    methods: tuple[str, ...] = METHODS
    further: tuple[str, ...] = ()
    situations: tuple[str, ...] = SITUATIONS
    study: str = ""
    steps: bool = False
    archived: bool = True
    draws: bool = True
    jobs: Callable[[Sequence[RunStatus], Path], Sequence[Job]] | None = None

    def write(
        self, runs: Sequence[FinishedRun], out: Path, budget: str, left_out: Sequence[str]
    ) -> list[Path]:
        """Write the report.

        Args:
            runs: the finished runs; where some failed or were left out, fewer than planned.
            out: folder of the study.
            budget: name of the budget they were trained with.
            left_out: what is to be said of each run that is not among ``runs``.

        Returns:
            The files that are there now; none without runs, where those of earlier runs are
            removed.

        Raises:
            RunError: runs cannot be compared, or matplotlib is not installed.
            OSError: a file cannot be written or removed.
        """
        report = self.report()
        files = [out / name for name in report.files]
        if runs:
            report.write(runs, out, budget, left_out)
        else:
            for path in files:
                path.unlink(missing_ok=True)
        return [path for path in files if path.exists()]


def _paper(*parts: str) -> Callable[[], Report]:
    def load() -> Report:
        from innerattn.report.paper.write import FILES, REPORT, write_report

        def write(
            runs: Sequence[FinishedRun], out: Path, budget: str, left_out: Sequence[str]
        ) -> None:
            write_report(runs, out, budget, parts, left_out)

        return Report((*REPORT, *(name for part in parts for name in FILES[part])), write)

    return load


def _crossed() -> Report:
    from innerattn.report.crossed.write import FILES, write_crossed

    return Report(FILES, write_crossed)


def _swapped() -> Report:
    from innerattn.report.crossed.swapped import FILES, write_swapped

    return Report(FILES, write_swapped)


def _learning(name: str) -> Callable[[], Report]:
    def load() -> Report:
        from innerattn.report.learning.write import learning_files, write_learning

        return Report(learning_files(name), partial(write_learning, name=name))

    return load


def _ablations() -> Report:
    from innerattn.report.learning.ablations import FILES, write_ablations

    return Report(FILES, write_ablations)


def _attention() -> Report:
    from innerattn.report.attention.write import FILES, write_attention

    return Report(FILES, write_attention)


def _robustness() -> Report:
    from innerattn.report.robustness.write import FILES, write_robustness

    return Report(FILES, write_robustness)


def _robustness_jobs(found: Sequence[RunStatus], out: Path) -> Sequence[Job]:
    from innerattn.experiments.robustness.measurement import missing_measurements

    return missing_measurements(found, out)


_INNER = tuple(method for method in METHODS if method.endswith("-inner"))
_TD = tuple(method for method in METHODS if method.startswith("td-"))

TARGETS: dict[str, Target] = {
    target.name: target
    for target in (
        Target(
            name="table2",
            shows="the paper's Table II, how two robots share their work",
            plan=plan,
            report=_paper("table2"),
            draws=False,
        ),
        Target(
            name="fig4",
            shows="the paper's Fig. 4, the entropy of attention in training",
            plan=plan,
            report=_paper("fig4"),
            steps=True,
            archived=False,
        ),
        Target(
            name="fig5",
            shows="the paper's Fig. 5, attention at handoffs",
            plan=plan,
            report=_paper("fig5"),
            methods=_INNER,
            steps=True,
            archived=False,
        ),
        Target(
            name="all",
            shows="table2, fig4 and fig5; archived runs count for table2",
            plan=plan,
            report=_paper("table2", "fig4", "fig5"),
            steps=True,
        ),
        Target(
            name="crossed",
            shows="which settings make robots share their work evenly",
            plan=plan_crossed,
            report=_crossed,
            methods=_TD,
            situations=CROSSED_SITUATIONS,
            study="crossed-",
        ),
        Target(
            name="swapped",
            shows="whether initial weights decide which robot does more",
            plan=plan_swapped,
            report=_swapped,
            methods=("td-uniform",),
            further=("td-inner",),
            situations=CROSSED_SITUATIONS,
            study="crossed-",
        ),
        Target(
            name="learning",
            shows="what each method learns",
            plan=plan,
            report=_learning("learning"),
            further=("mappo",),
            situations=LEARNING_SITUATIONS,
        ),
        Target(
            name="learning-entities",
            shows="what each method learns with entity encoders",
            plan=ENTITIES.plan,
            report=_learning("learning_entities"),
            situations=LEARNING_SITUATIONS,
        ),
        Target(
            name="learning-continuous",
            shows="what PPO learns with continuous actions",
            plan=CONTINUOUS.plan,
            report=_learning("learning_continuous"),
            methods=("ppo-inner",),
            further=("ppo-uniform", "mappo"),
            situations=LEARNING_SITUATIONS,
        ),
        Target(
            name="learning-warm-start",
            shows="what each method learns after it imitated hungarian",
            plan=WARM_START.plan,
            report=_learning("learning_warm_start"),
            situations=LEARNING_SITUATIONS,
        ),
        Target(
            name="learning-long",
            shows="what PPO learns in 30 million env-steps",
            plan=LONG.plan,
            report=_learning("learning_long"),
            methods=("mappo",),
            further=("ppo-inner", "ppo-uniform"),
            situations=LEARNING_SITUATIONS,
        ),
        Target(
            name="learning-afterstates",
            shows="what PPO learns in as many with the values of afterstates",
            plan=AFTERSTATES.plan,
            report=_learning("learning_afterstates"),
            methods=("mappo",),
            further=("ppo-inner", "ppo-uniform"),
            situations=LEARNING_SITUATIONS,
        ),
        Target(
            name="learning-ablations",
            shows="what each choice of the recipe of PPO is worth",
            plan=plan_ablations,
            report=_ablations,
            methods=("ppo-inner",),
            further=("ppo-uniform", "mappo"),
            situations=("mixed",),
            draws=False,
        ),
        Target(
            name="attention",
            shows="what learnt attention is worth in teams of 4, 8 and 16",
            plan=plan,
            report=_attention,
            methods=ATTENTION_METHODS,
            situations=ATTENTION_SITUATIONS,
        ),
        Target(
            name="robustness",
            shows="what faults cost a team, and where attention goes",
            plan=plan_robustness,
            report=_robustness,
            situations=("mixed",),
            draws=False,
            jobs=_robustness_jobs,
        ),
    )
}
"""By name, in the order in which the command lists them."""
