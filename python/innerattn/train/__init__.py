"""Training: a policy acts in worlds, a learner learns from the transitions, a run folder holds all.

It writes the run's metrics, and neither evaluates nor prints.
"""

from innerattn.records.run_folder import RunInfo, read_info
from innerattn.train.checkpoint import RunFolder
from innerattn.train.loop import Progress, resume, train
from innerattn.train.policy import NewestPolicy, load_newest, load_policy
from innerattn.train.resume import (
    DamagedCheckpointError,
    NothingToResumeError,
    newest_checkpoint,
)

__all__ = [
    "DamagedCheckpointError",
    "NewestPolicy",
    "NothingToResumeError",
    "Progress",
    "RunFolder",
    "RunInfo",
    "load_newest",
    "load_policy",
    "newest_checkpoint",
    "read_info",
    "resume",
    "train",
]
