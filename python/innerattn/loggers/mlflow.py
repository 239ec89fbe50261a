"""MLflow; its own settings say where to, such as ``MLFLOW_TRACKING_URI``."""

from __future__ import annotations

import os
import time
from collections.abc import Mapping

from mlflow import MlflowClient
from mlflow.entities import Metric, Param

from innerattn.loggers.logger import Ending, Opened

EXPERIMENT = "innerattn"
"""Unless ``MLFLOW_EXPERIMENT_NAME`` names another one."""

_MOST_PARAMETERS = 100  # in one request
_LONGEST_PARAMETER = 6_000  # letters
_STATUS: Mapping[Ending, str] = {"done": "FINISHED", "interrupted": "KILLED", "failed": "FAILED"}


def open_mlflow(run: Opened) -> MlflowLogger:
    """A logger with an MLflow run of its own, which is not the active run of the process."""
    client = MlflowClient()
    name = os.environ.get("MLFLOW_EXPERIMENT_NAME", EXPERIMENT)
    known = client.get_experiment_by_name(name)
    experiment = client.create_experiment(name) if known is None else known.experiment_id
    run_id = client.create_run(experiment, run_name=run.name).info.run_id
    parameters = [
        Param(key, str(value)[:_LONGEST_PARAMETER]) for key, value in run.parameters.items()
    ]
    for start in range(0, len(parameters), _MOST_PARAMETERS):
        client.log_batch(run_id, params=parameters[start : start + _MOST_PARAMETERS])
    return MlflowLogger(client, run_id)


class MlflowLogger:
    """Sends numbers by env-steps."""

    def __init__(self, client: MlflowClient, run_id: str) -> None:
        self._client, self._run_id = client, run_id

    def log(self, env_steps: int, values: Mapping[str, float]) -> None:
        """Send the numbers in one request."""
        now = time.time_ns() // 1_000_000
        metrics = [Metric(name, value, now, env_steps) for name, value in values.items()]
        self._client.log_batch(self._run_id, metrics=metrics)

    def close(self, ending: Ending, /) -> None:
        """Say how the run ended."""
        self._client.set_terminated(self._run_id, _STATUS[ending])
