"""Configuration as data: the scenario of a world and everything a run needs to be repeated.

It validates and reads and writes TOML; it steps no world, trains nothing and prints nothing.
Each module is imported when one of its names is asked for: a scenario does without the rest.
"""

from typing import TYPE_CHECKING

from innerattn.lazy import lazy_names

if TYPE_CHECKING:
    from innerattn.config.algorithm import Algorithm, AlgorithmConfig
    from innerattn.config.battery import Battery, Depot, Station
    from innerattn.config.communication import Communication
    from innerattn.config.family import Family
    from innerattn.config.load import load_run_config, read_toml, write_toml
    from innerattn.config.map import Map
    from innerattn.config.ppo import PPOConfig
    from innerattn.config.range_sensor import RangeSensor
    from innerattn.config.registry import register_algorithm, register_attention
    from innerattn.config.run import BUDGETS, RunConfig, refuse_late_faults
    from innerattn.config.scenario import SCENARIOS, Fault, Obstacle, Robot, Scenario
    from innerattn.config.sections import (
        EvaluateConfig,
        ImitationConfig,
        NetworkConfig,
        TrainConfig,
    )
    from innerattn.config.task import Arrival, Task
    from innerattn.config.td import TDConfig

__all__ = [
    "BUDGETS",
    "SCENARIOS",
    "Algorithm",
    "AlgorithmConfig",
    "Arrival",
    "Battery",
    "Communication",
    "Depot",
    "EvaluateConfig",
    "Family",
    "Fault",
    "ImitationConfig",
    "Map",
    "NetworkConfig",
    "Obstacle",
    "PPOConfig",
    "RangeSensor",
    "Robot",
    "RunConfig",
    "Scenario",
    "Station",
    "TDConfig",
    "Task",
    "TrainConfig",
    "load_run_config",
    "read_toml",
    "refuse_late_faults",
    "register_algorithm",
    "register_attention",
    "write_toml",
]

__getattr__ = lazy_names(
    __name__,
    {
        "Algorithm": "algorithm",
        "AlgorithmConfig": "algorithm",
        "Arrival": "task",
        "BUDGETS": "run",
        "Battery": "battery",
        "Communication": "communication",
        "Depot": "battery",
        "EvaluateConfig": "sections",
        "Family": "family",
        "Fault": "scenario",
        "ImitationConfig": "sections",
        "NetworkConfig": "sections",
        "Map": "map",
        "Obstacle": "scenario",
        "PPOConfig": "ppo",
        "RangeSensor": "range_sensor",
        "Robot": "scenario",
        "RunConfig": "run",
        "SCENARIOS": "scenario",
        "Scenario": "scenario",
        "Station": "battery",
        "TDConfig": "td",
        "Task": "task",
        "TrainConfig": "sections",
        "load_run_config": "load",
        "read_toml": "load",
        "refuse_late_faults": "run",
        "register_algorithm": "registry",
        "register_attention": "registry",
        "write_toml": "load",
    },
)
