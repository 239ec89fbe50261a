"""`innerattn reproduce`: train the runs that a table or figure needs, then write it."""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal, TypeAlias

import tyro
from rich.console import Console

from innerattn.cli.options import Command, UsageError
from innerattn.cli.progress import SeveralRuns
from innerattn.config import BUDGETS
from innerattn.experiments.crossed.arms import SITUATIONS as CROSSED_SITUATIONS
from innerattn.experiments.crossed.arms import plan_crossed
from innerattn.experiments.plan import SITUATIONS, TARGETS, PlannedRun, plan
from innerattn.experiments.smoke import smoke_note
from innerattn.report.tables.experiments import print_scores

if TYPE_CHECKING:
    from innerattn.experiments.lock import StudyLock
    from innerattn.experiments.scan import RunStatus

    Target: TypeAlias = str
    Budget: TypeAlias = str
else:
    Target, Budget = Literal[tuple(TARGETS)], Literal[BUDGETS]

_MOST_SEEDS = 1_000


@dataclass(kw_only=True)
class Reproduce(Command):
    """Train the runs that a table or figure of the paper needs, then write it with a report.

    Runs that are there already are kept; the same command goes on with what is missing.
    """

    target: tyro.conf.Positional[Target]
    """What to make; all: table2, fig4 and fig5; crossed: a design on what makes sharing even."""
    budget: Budget = "quick"
    """How long to train; quick gives no result; paper: its own numbers, for PPO the few printed."""
    seeds: int = 5
    """How many seeds: 0, 1, ... up to one less."""
    out: Path | None = None
    """Folder of the study, its runs in runs; None: studies/BUDGET or studies/crossed-BUDGET."""
    methods: str = "all"
    """Methods, separated by commas; all: what the target needs."""
    situations: str = "all"
    """Situations, separated by commas; all: what the target needs."""
    report_only: tyro.conf.FlagCreatePairsOff[bool] = False
    """Train nothing: report on the runs that are finished, and name the others."""

    def run(self) -> int:
        """Plan, train, print, write.

        Returns:
            The exit code: 0, or 1 where a run failed or is left out.

        Raises:
            InnerattnError: wrong options, matplotlib is needed and not installed, or another study
                is at work in the same folder.
            OSError: a file cannot be written.
            KeyboardInterrupt: the user stopped it; finished runs are kept.
        """
        name = f"crossed-{self.budget}" if self.target == "crossed" else self.budget
        out = self.out or Path("studies") / name
        planned = self._planned(out)

        from innerattn.experiments.account import write_account
        from innerattn.experiments.lock import StudyLock
        from innerattn.experiments.scan import finished_runs, scan_runs
        from innerattn.experiments.score_means import method_scores
        from innerattn.report.outputs import make_outputs
        from innerattn.report.plots.drawing import check_format

        if self.target != "table2":
            check_format(out / "figure.png")  # before hours of training, not after
        whole = self.target not in ("table2", "crossed")
        console = Console(markup=False, highlight=False)
        with StudyLock.take(out) as lock:
            found = scan_runs(planned, out, whole=whole)
            self._print_plan(console, found, out)
            try:
                if not self.report_only:
                    self._train(found, out, lock)
            except KeyboardInterrupt:
                found = scan_runs(planned, out, whole=whole)
                write_account(out, self.target, self.budget, found)
                _say_what_is_kept(found)
                raise
            if not self.report_only:
                found = scan_runs(planned, out, whole=whole)
            write_account(out, self.target, self.budget, found)
            note = smoke_note(self.budget)
            unusable = [one for one in found if one.state != "finished"]
            reasons = [f"{one.planned.case}: {_reason(one)}" for one in unusable]
            runs = finished_runs(found)
            outputs = make_outputs(self.target, runs, out, self.budget, reasons)
            account = write_account(out, self.target, self.budget, found, outputs)
        print_scores(console, method_scores(found))
        if reasons:
            console.print("Runs that are not in it", style="bold")
        for reason in reasons:
            console.print(f"  {reason}", soft_wrap=True)
        for path in (*outputs, account):
            console.print(f"Written: {path}", soft_wrap=True)
        if note:
            console.print(note[:1].upper() + note[1:], style="bold")
        return int(bool(unusable))

    def _planned(self, out: Path) -> list[PlannedRun]:
        methods = _chosen("methods", self.methods, TARGETS[self.target])
        crossed = self.target == "crossed"
        named = ",".join(CROSSED_SITUATIONS) if crossed and self.situations == "all" else None
        situations = _chosen("situations", named or self.situations, SITUATIONS)
        if not 1 <= self.seeds <= _MOST_SEEDS:
            raise UsageError(f"--seeds = {self.seeds}: must be 1 to {_MOST_SEEDS:,}")
        make = plan_crossed if crossed else plan
        return make(methods, situations, range(self.seeds), self.budget, out)

    def _print_plan(self, console: Console, found: Sequence[RunStatus], out: Path) -> None:
        from innerattn.experiments.train import places, to_measure, to_train

        states = Counter(one.state for one in found)
        train, measure = len(to_train(found)), len(to_measure(found))
        count = train + measure
        left_out = len(found) - count - states["finished"]
        line = f"{self.target}, budget {self.budget}: {len(found)} runs of {_seeds(self.seeds)}; "
        line += f"{states['finished']} finished, "
        if self.report_only:
            line += f"{count} not"
        else:
            line += f"{train} to train" + (f", {measure} to measure only" if measure else "")
            line += f", {places(count)} at a time" if count else ""
        line += f"; {left_out} left out" if left_out else ""
        console.print(line, soft_wrap=True)
        note = smoke_note(self.budget)
        if note:
            console.print(note[:1].upper() + note[1:], style="bold")
        console.print(f"Study folder: {out}", soft_wrap=True)
        for one in found:
            if one.state in ("other_configuration", "unreadable"):
                text = f"left out: {one.planned.folder}: {_reason(one)}"
                print(f"innerattn: {text} (move it away to have it trained)", file=sys.stderr)

    def _train(self, found: Sequence[RunStatus], out: Path, lock: StudyLock) -> None:
        from innerattn.experiments.train import train_missing

        with SeveralRuns() as progress:
            train_missing(found, out, lock, changed=progress, failed=_say_why, debug=self.debug)


def _chosen(option: str, text: str, known: Sequence[str]) -> tuple[str, ...]:
    """The names that ``text`` lists, in the order of ``known``."""
    names = {name.strip() for name in text.split(",")}
    if names == {"all"}:
        return tuple(known)
    unknown = sorted(names - set(known))
    if unknown:
        raise UsageError(f"--{option} = {unknown[0]!r}: must be all or of {', '.join(known)}")
    return tuple(name for name in known if name in names)


def _seeds(count: int) -> str:
    return "1 seed" if count == 1 else f"{count} seeds"


def _reason(found: RunStatus) -> str:
    return f"{found.state.replace('_', ' ')}: {found.why}" if found.why else found.state


def _say_why(planned: PlannedRun, reason: str) -> None:
    print(f"innerattn: error: {planned.case}: {reason}", file=sys.stderr)


def _say_what_is_kept(found: Sequence[RunStatus]) -> None:
    done = sum(one.state == "finished" for one in found)
    text = f"{done} of {len(found)} runs are finished and kept; the same command goes on with them"
    print(f"innerattn: {text}", file=sys.stderr)
