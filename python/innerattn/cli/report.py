"""`innerattn report`: one page about finished runs."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from innerattn.cli.options import Command, UsageError, check_target
from innerattn.cli.runs import existing_run
from innerattn.config.files import write_whole
from innerattn.errors import RunError
from innerattn.zoo import in_zoo


@dataclass(kw_only=True)
class Report(Command):
    """Write one page about finished runs: training, scores, attention, sharing and a replay."""

    runs: Annotated[tyro.conf.Positional[list[str]], tyro.conf.arg(metavar="RUN [RUN ...]")]
    """Folders of finished runs, of any scenarios and methods."""
    output: Annotated[Path, tyro.conf.arg(aliases=["-o"])] = Path("report.html")
    """File to write, .html."""
    robustness: Path | None = None
    """File that innerattn robustness --json wrote, to show too."""

    def run(self) -> int:
        """Read and write.

        Returns:
            The exit code, 0.

        Raises:
            InnerattnError: a run is not finished, or two runs differ by nothing.
            OSError: the page cannot be written.
        """
        if not self.runs:
            raise UsageError("RUN: at least one run is needed")
        if self.output.suffix != ".html":
            raise UsageError(f"-o {self.output}: must end in .html")
        check_target(self.output)
        folders = [existing_run(run) for run in self.runs]
        for run, folder in zip(self.runs, folders, strict=True):
            if in_zoo(folder):
                raise RunError(f"{run}: a team of the package has no metrics for a report")
        from innerattn.report.runs.page import read_robustness, read_runs, runs_page

        document = None if self.robustness is None else read_robustness(self.robustness)
        page = runs_page(read_runs(folders), document)
        write_whole(self.output, page.encode(errors="backslashreplace"))
        count = "1 run" if len(self.runs) == 1 else f"{len(self.runs)} runs"
        print(f"{self.output}: {count}, {self.output.stat().st_size / 1e6:.1f} MB")
        return 0
