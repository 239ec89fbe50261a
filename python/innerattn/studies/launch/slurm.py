"""A script for Slurm whose jobs are workers of a study; nothing is submitted here."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path

_SCRIPT = """\
#!/bin/bash
# {jobs} workers for the study in {folder}. Each works through runs until none is left or its time
# is up, then saves the run at hand; submit the script again to go on.
#SBATCH --job-name=innerattn-{name}
#SBATCH --array=1-{jobs}
#SBATCH --cpus-per-task=1
#SBATCH --time={minutes}
#SBATCH --signal=TERM@120
#SBATCH --output={log}

exec srun {python} -m innerattn study work {folder} --until {until}m
"""


def slurm_script(folder: Path, jobs: int, minutes: int) -> str:
    """The text of a script for `sbatch`, an array of jobs.

    Args:
        folder: of the study, on a file system that the nodes see.
        jobs: workers.
        minutes: time limit of a job, above 5; the worker stops 3 minutes before it.
    """
    path = folder.resolve()
    return _SCRIPT.format(
        name=folder.name,
        folder=shlex.quote(str(path)),
        log=shlex.quote(str(path / "slurm-%A_%a.out")),
        python=shlex.quote(sys.executable),
        jobs=jobs,
        minutes=minutes,
        until=minutes - 3,
    )
