"""What `innerattn reproduce` can make: shipped studies, and what writes their reports.

Modules that write reports load more than the options of a command need, so each is imported when
its report is written.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from innerattn.studies.shipped import shipped_table

if TYPE_CHECKING:
    from innerattn.experiments.run import FinishedRun


WriteReport = Callable[["Sequence[FinishedRun]", Path, str, Sequence[str]], object]
"""Writes a report of runs into a folder, of runs of a budget; the last is said of missing runs."""


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
        report: loads its report; None: that of every study, `innerattn.report.study.write`.
        file: name of its shipped study; None: its own name.
        few: methods that it has unless others are chosen; None: all of its file.
        further: other methods that can be chosen, too.
        pool: begins the name of the folder of its runs, which ends in the budget.
        steps: whether it needs metrics and steps of runs.
        archived: whether archived runs do, which have neither; for "all" they do for the table.
        under_faults: whether finished runs have to meet faults before the report.
    """

    name: str
    shows: str
    report: Callable[[], Report] | None = None
    file: str | None = None
    few: tuple[str, ...] | None = None
    further: tuple[str, ...] = ()
    pool: str = ""
    steps: bool = False
    archived: bool = True
    under_faults: bool = False

    @cached_property
    def table(self) -> dict[str, Any]:
        """What the file of its study says."""
        return shipped_table(self.file or self.name)

    @property
    def known(self) -> tuple[str, ...]:
        """Methods that can be chosen."""
        own = (method for grid in self.table["grid"] for method in grid["methods"])
        return tuple(dict.fromkeys((*own, *self.further)))

    @property
    def methods(self) -> tuple[str, ...]:
        """Methods that it has unless others are chosen."""
        return self.few or tuple(one for one in self.known if one not in self.further)

    @property
    def situations(self) -> tuple[str, ...]:
        """Built-in scenarios that it has unless others are chosen."""
        return tuple(self.table["grid"][0]["scenarios"])


def write_special(
    report: Report, runs: Sequence[FinishedRun], out: Path, budget: str, left_out: Sequence[str]
) -> list[Path]:
    """Write a report of a target's own.

    Args:
        report: of the target.
        runs: the finished runs; where some failed or were left out, fewer than planned.
        out: folder of the study.
        budget: name of the budget they were trained with.
        left_out: what is to be said of each run that is not among ``runs``.

    Returns:
        The files that are there now; none without runs, where those of earlier runs are removed.

    Raises:
        RunError: runs cannot be compared, or matplotlib is not installed.
        OSError: a file cannot be written or removed.
    """
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

        files = (*REPORT, *(name for part in parts for name in FILES[part]))
        return Report(files, partial(write_report, parts=parts))

    return load


def _crossed() -> Report:
    from innerattn.report.crossed.write import FILES, write

    return Report(FILES, write)


def _swapped() -> Report:
    from innerattn.report.crossed.swapped import FILES, write

    return Report(FILES, write)


def _robustness() -> Report:
    from innerattn.report.robustness.page import FILES, write

    return Report(FILES, write)


TARGETS: dict[str, Target] = {
    target.name: target
    for target in (
        Target(
            name="table2",
            shows="the paper's Table II, how two robots share their work",
            report=_paper("table2"),
            file="paper",
        ),
        Target(
            name="fig4",
            shows="the paper's Fig. 4, the entropy of attention in training",
            report=_paper("fig4"),
            file="paper",
            steps=True,
            archived=False,
        ),
        Target(
            name="fig5",
            shows="the paper's Fig. 5, attention at handoffs",
            report=_paper("fig5"),
            file="paper",
            few=("td-inner", "ppo-inner"),
            steps=True,
            archived=False,
        ),
        Target(
            name="all",
            shows="table2, fig4 and fig5; archived runs count for table2",
            report=_paper("table2", "fig4", "fig5"),
            file="paper",
            steps=True,
        ),
        Target(
            name="crossed",
            shows="which settings make robots share their work evenly",
            report=_crossed,
            pool="crossed-",
        ),
        Target(
            name="swapped",
            shows="whether initial weights decide which robot does more",
            report=_swapped,
            few=("td-uniform",),
            pool="crossed-",
        ),
        Target(name="learning", shows="what each method learns", further=("mappo",)),
        Target(
            name="learning-entities",
            shows="what each method learns with entity encoders",
        ),
        Target(
            name="learning-continuous",
            shows="what PPO learns with continuous actions",
            few=("ppo-inner",),
        ),
        Target(
            name="learning-warm-start",
            shows="what each method learns after it imitated hungarian",
        ),
        Target(
            name="learning-long",
            shows="what PPO learns in 30 million env-steps",
            few=("mappo",),
        ),
        Target(
            name="learning-afterstates",
            shows="what PPO learns in as many with the values of afterstates",
            few=("mappo",),
        ),
        Target(
            name="learning-ablations",
            shows="what each choice of the recipe of PPO is worth",
            further=("ppo-uniform", "mappo"),
        ),
        Target(name="attention", shows="what learnt attention is worth in teams of 4, 8 and 16"),
        Target(
            name="robustness",
            shows="what faults cost a team, and where attention goes",
            report=_robustness,
            under_faults=True,
        ),
    )
}
"""By name, in the order in which the command lists them."""
