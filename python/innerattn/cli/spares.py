"""Spare robots of `innerattn play` and `innerattn page`, as ``--spare`` asks for them."""

from __future__ import annotations

from collections.abc import Sequence

from innerattn.cli.options import UsageError
from innerattn.config import Scenario
from innerattn.errors import ConfigError
from innerattn.evaluate.spares import MOST_ROBOTS, with_spares, with_usual_spares
from innerattn.records.run_folder import read_config


def check_spare(spare: int | None) -> None:
    """Refuse a number that no world takes.

    Raises:
        UsageError: it is out of range.
    """
    if spare is not None and not 0 <= spare < MOST_ROBOTS:
        raise UsageError(f"--spare {spare}: must be 0 to {MOST_ROBOTS - 1}")


def spared(scenario: Scenario, runs: Sequence[str], spare: int | None) -> Scenario:
    """The worlds with spare robots behind the scenario's own, if all policies take robots in.

    Scripts do; of runs those with a policy for any team do.

    Args:
        scenario: the worlds.
        runs: the run folders whose policies act in them.
        spare: how many of each kind; None: two, or as many as there is room for.

    Raises:
        ConfigError: some were asked for, and a policy or the worlds take none in.
        RunError: there is no readable run.
    """
    fixed = [run for run in runs if not read_config(run).algorithm.for_any_team]
    if spare and fixed:
        raise ConfigError(
            f"--spare {spare}: must be 0 with {fixed[0]}, whose policy acts in teams of "
            f"{read_config(fixed[0]).scenario.num_robots} robots alone"
        )
    if fixed:
        return scenario
    if spare is None:
        return with_usual_spares(scenario)
    try:
        return with_spares(scenario, spare)
    except ConfigError as error:
        raise ConfigError(f"--spare {spare}: {error}") from error
