"""Jobs of a study one after the other in this process, for tests that need no processes."""

from collections.abc import Callable, Sequence

from innerattn.errors import InnerattnError
from innerattn.experiments.processes import Job


def do_in_turn(
    jobs: Sequence[Job],
    at_once: int,
    *,
    changed: Callable[[Sequence[Job]], None],
    failed: Callable[[Job], None],
    **_: object,
) -> None:
    """What `run_side_by_side` does, without processes, which take long to start."""
    assert at_once >= 1
    for job in jobs:
        try:
            job.result = job.do(lambda _: None)
            job.state, job.share = "done", 1.0
        except InnerattnError as error:
            job.state, job.failure = "failed", str(error)
            failed(job)
        changed(jobs)
