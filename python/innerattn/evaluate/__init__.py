"""Evaluation: runs policies, records episodes, and computes results from the records alone.

It trains nothing and prints nothing. What plays trained teams is imported when it is asked for:
scripts are played and recorded without torch.
"""

from typing import TYPE_CHECKING

from innerattn.evaluate.play import run_episodes
from innerattn.lazy import lazy_names
from innerattn.measures.summary import Performance, Summary
from innerattn.policies import SCRIPTED, Policy, PolicyInput, scripted_policy
from innerattn.records.parquet import read_records, write_records
from innerattn.records.record import Record
from innerattn.stats import Estimate
from innerattn.stats.student import student_interval

if TYPE_CHECKING:
    from innerattn.evaluate.measure import Evaluation, evaluate_policy, evaluate_run
    from innerattn.evaluate.trained import TrainedPolicy, load_trained

__all__ = [
    "SCRIPTED",
    "Estimate",
    "Evaluation",
    "Performance",
    "Policy",
    "PolicyInput",
    "Record",
    "Summary",
    "TrainedPolicy",
    "evaluate_policy",
    "evaluate_run",
    "load_trained",
    "read_records",
    "run_episodes",
    "scripted_policy",
    "student_interval",
    "write_records",
]

__getattr__ = lazy_names(
    __name__,
    {
        "Evaluation": "measure",
        "TrainedPolicy": "trained",
        "evaluate_policy": "measure",
        "evaluate_run": "measure",
        "load_trained": "trained",
    },
)
