"""A finished run in small, to be published or carried elsewhere: what its figures come from."""

from __future__ import annotations

import json
import os
import shutil
from dataclasses import asdict, replace
from pathlib import Path

from innerattn.config.files import write_whole
from innerattn.errors import RunError
from innerattn.experiments.run import StudyRun, digests, read_measured
from innerattn.records.parquet import write_records
from innerattn.records.run_folder import plain_file, read_info


def keep(run: StudyRun, target: Path) -> None:
    """Make a small copy of a run folder, some hundredth of its size.

    It holds the configuration, ``run.json`` with the digest of the weights, and of the evaluation
    the summary and the run's own episodes of the standard length: steps, rescues and sums of
    rewards. It lacks weights, metrics, what was recorded step by step, and what other policies
    did. A study takes it for a finished run; what needs the rest, such as Fig. 4 and Fig. 5,
    refuses it.

    Args:
        run: which.
        target: the copy; one that is there already stays as it is.

    Raises:
        RunError: the run has no weights or no finished evaluation, or another is at ``target``.
        ConfigError: a configuration cannot be read.
        OSError: a file cannot be read or written; the copy is made whole or not at all.
    """
    named = digests(run.folder)
    if os.path.lexists(target):
        if digests(target) != named:
            raise RunError(f"{target}: holds another run than {run.folder}; remove one of them")
        return
    info = replace(read_info(run.folder), weights_sha256=named.weights)
    scored = read_measured(run, step_by_step=False).scored
    partial = target.with_name(f".{target.name}.{os.getpid()}")
    partial.mkdir(parents=True)
    try:
        for name in ("config.toml", "evaluation/summary.json"):
            source = plain_file(run.folder / name)
            (partial / name).parent.mkdir(exist_ok=True)
            write_whole(partial / name, source.read_bytes())
        write_whole(partial / "run.json", f"{json.dumps(asdict(info), indent=1)}\n".encode())
        write_records([replace(record, steps={}) for record in scored], partial / "evaluation")
        os.rename(partial, target)
    except BaseException:
        shutil.rmtree(partial, ignore_errors=True)
        raise
