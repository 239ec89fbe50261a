"""Training: policy and worlds make data, a learner learns from it, a run folder keeps the result.

It measures and prints nothing beyond the run's own metrics.
"""

from innerattn.records.run_folder import RunInfo, read_info
from innerattn.train.checkpoint import RunFolder, load_policy
from innerattn.train.loop import Progress, train

__all__ = ["Progress", "RunFolder", "RunInfo", "load_policy", "read_info", "train"]
