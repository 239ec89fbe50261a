"""`innerattn seal`: a manifest for runs, and a digest for archives, that are older than these."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from innerattn.cli.options import Command, UsageError


@dataclass(kw_only=True)
class Seal(Command):
    """Check an older run and add the missing manifest."""

    runs: Annotated[tyro.conf.Positional[list[Path]], tyro.conf.arg(metavar="RUN [RUN ...]")]
    """Folders of runs that are over, or archives of studies (.parquet)."""

    def run(self) -> int:
        """Check, seal and say what was sealed; stops at the first that is damaged.

        Returns:
            The exit code, 0.

        Raises:
            InnerattnError: something is damaged, or sealed already.
            OSError: a file cannot be read or written.
        """
        if not self.runs:
            raise UsageError("RUN: at least one run is needed")
        from innerattn.experiments.archive import seal_archive
        from innerattn.experiments.seal import seal_run

        for path in self.runs:
            if path.suffix == ".parquet":
                print(f"{path}: sealed {seal_archive(path)} runs")
                continue
            sealed = seal_run(path)
            print(f"{path}: sealed {len(sealed.files)} files, {sealed.bytes / 1e6:.1f} MB")
            print(f"  checked: {', '.join(sealed.checked)}")
            if sealed.unread:
                print(f"  sealed as they are, nothing reads them: {', '.join(sealed.unread)}")
        return 0
