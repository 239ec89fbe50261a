"""Training: a policy acts in worlds, a learner learns from the transitions, a run folder holds all.

It writes the run's metrics, and neither evaluates nor prints.
"""

from innerattn.records.run_folder import RunInfo, read_info
from innerattn.train.checkpoint import RunFolder, load_policy
from innerattn.train.loop import Progress, train

__all__ = ["Progress", "RunFolder", "RunInfo", "load_policy", "read_info", "train"]
