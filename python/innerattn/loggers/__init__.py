"""Metrics of a training sent to other tools while it goes on: TensorBoard, W&B, MLflow, trackio.

A logger reads what training reports and changes nothing of it. Its library is imported when the
logger is opened; none is needed otherwise.
"""

from innerattn.loggers.logger import LOGGERS, MetricsLogger, Opened, open_logger
from innerattn.loggers.of_run import RunLoggers

__all__ = ["LOGGERS", "MetricsLogger", "Opened", "RunLoggers", "open_logger"]
