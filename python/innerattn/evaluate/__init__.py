"""Evaluation: runs policies, records episodes, and computes results from the records alone.

It trains nothing and prints nothing.
"""

from innerattn.evaluate.measure import Evaluation, evaluate_policy, evaluate_run
from innerattn.evaluate.play import run_episodes
from innerattn.evaluate.trained import TrainedPolicy, load_trained
from innerattn.measures.summary import Performance, Summary
from innerattn.policies import SCRIPTED, Policy, PolicyInput, scripted_policy
from innerattn.records.parquet import read_records, write_records
from innerattn.records.record import Record
from innerattn.stats import Estimate
from innerattn.stats.student import student_interval

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
