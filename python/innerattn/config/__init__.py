"""Configuration as data: the scenario of a world and everything a run needs to be repeated.

It validates and reads and writes TOML; it steps no world, trains nothing and prints nothing.
"""

from innerattn.config.load import load_run_config, read_toml, write_toml
from innerattn.config.run import (
    BUDGETS,
    EvaluateConfig,
    ImitationConfig,
    NetworkConfig,
    PPOConfig,
    RunConfig,
    TDConfig,
    TrainConfig,
    refuse_late_faults,
)
from innerattn.config.scenario import SCENARIOS, Fault, Obstacle, Robot, Scenario, Task

__all__ = [
    "BUDGETS",
    "SCENARIOS",
    "EvaluateConfig",
    "Fault",
    "ImitationConfig",
    "NetworkConfig",
    "Obstacle",
    "PPOConfig",
    "Robot",
    "RunConfig",
    "Scenario",
    "TDConfig",
    "Task",
    "TrainConfig",
    "load_run_config",
    "read_toml",
    "refuse_late_faults",
    "write_toml",
]
