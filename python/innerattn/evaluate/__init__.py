"""Evaluation: runs policies, records episodes, and computes figures from the records alone.

It trains nothing and prints nothing.
"""

from innerattn.evaluate.episodes import Record, run_episodes
from innerattn.evaluate.measure import Evaluation, evaluate_policy, evaluate_run
from innerattn.evaluate.records import read_records, write_records
from innerattn.evaluate.statistics import Interval, student_interval
from innerattn.evaluate.summary import Figures, Summary
from innerattn.evaluate.trained import TrainedPolicy, load_trained
from innerattn.scripted import SCRIPTED, Policy, View, scripted_policy

__all__ = [
    "SCRIPTED",
    "Evaluation",
    "Figures",
    "Interval",
    "Policy",
    "Record",
    "Summary",
    "TrainedPolicy",
    "View",
    "evaluate_policy",
    "evaluate_run",
    "load_trained",
    "read_records",
    "run_episodes",
    "scripted_policy",
    "student_interval",
    "write_records",
]
