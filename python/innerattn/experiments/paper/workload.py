"""How the two food robots of a run share its rescues."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from innerattn.errors import RunError
from innerattn.experiments.run import FinishedRun
from innerattn.measures.sharing.evenness import counts_by_episode


def rescues_by_task(run: FinishedRun) -> dict[str, NDArray[np.int64]]:
    """Rescues of each task by food robot, (2,), over all episodes of the standard length.

    Raises:
        RunError: a task is not one that two robots share.
    """
    parts = [counts_by_episode(record) for record in run.scored]
    counts = {task: np.sum([part[task].sum(0) for part in parts], 0) for task in parts[0]}
    for task, by_robot in counts.items():
        if len(by_robot) != 2:
            raise RunError(f"{run.folder}: {task} is shared by {len(by_robot)} robots; must be two")
    return counts
