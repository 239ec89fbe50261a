"""Runs of different scenarios, methods and settings, sorted into groups that have a name."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace

from innerattn.experiments.run import FinishedRun, by_method, comparable


def grouped(runs: Sequence[FinishedRun]) -> list[list[FinishedRun]]:
    """Groups of runs that differ by their seeds alone, each with a situation of its own.

    Where a situation has several scenarios, or a method several settings in the same worlds, the
    name of the situation tells which run's it is, such as "mixed as in flood-s0".

    Raises:
        RunError: there are none, or two runs of a group have the same seed.
    """
    worlds = [json.dumps(run.config.scenario.model_dump(mode="json")) for run in runs]
    settings = [json.dumps(comparable(run.config)) for run in runs]
    named = _named(runs, [(run.case.worlds,) for run in runs], worlds)
    named = _named(named, [(run.case.worlds, run.method) for run in named], settings)
    return list(by_method(named).values())


def in_situations(
    groups: Sequence[Sequence[FinishedRun]],
) -> dict[str, list[Sequence[FinishedRun]]]:
    """The groups of each situation, in the order in which these first appear."""
    found: dict[str, list[Sequence[FinishedRun]]] = {}
    for group in groups:
        found.setdefault(group[0].case.worlds, []).append(group)
    return found


def _named(
    runs: Sequence[FinishedRun], keys: Sequence[tuple[str, ...]], variants: Sequence[str]
) -> list[FinishedRun]:
    """The runs; those of a key with several variants are named after the first of their variant."""
    firsts: dict[tuple[str, ...], dict[str, FinishedRun]] = {}
    for run, key, variant in zip(runs, keys, variants, strict=True):
        firsts.setdefault(key, {}).setdefault(variant, run)
    found = []
    for run, key, variant in zip(runs, keys, variants, strict=True):
        if len(firsts[key]) > 1:
            first = firsts[key][variant]
            name = f"{first.config.scenario.situation} as in {first.folder.name}"
            run = replace(run, case=replace(run.case, worlds=name))
        found.append(run)
    return found
