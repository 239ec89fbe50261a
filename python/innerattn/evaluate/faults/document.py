"""The figures of robustness as one document; it runs nothing and prints nothing."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from innerattn.evaluate.faults.grid import ONSETS, Grid, Retention
from innerattn.evaluate.faults.severity import fault_of
from innerattn.stats import Estimate
from innerattn.stats.bootstrap import Resampled

SCHEMA_VERSION = 1


def robustness_document(grid: Grid, found: Mapping[str, Retention], runs: Mapping[str, str]) -> Any:
    """What `robustness --json` holds about retention.

    Args:
        grid: the faults.
        found: what each policy keeps, by name; the first is the one that others are compared with.
        runs: training method by name, of those policies that are trained.
    """
    first = next(iter(found))
    return {
        "schema_version": SCHEMA_VERSION,
        "situation": grid.scenario.situation,
        "robots": [robot.name for robot in grid.scenario.robots],
        "episodes": grid.episodes,
        "episode_steps": grid.scenario.episode_steps,
        "seed": grid.seed,
        "onset_steps": {"start": 0, "middle": grid.middle},
        "severities": list(grid.severities),
        "policies": [
            {"policy": name, "method": runs.get(name, name), **_policy(grid, kept)}
            for name, kept in found.items()
        ],
        "differences": [
            {
                "policy": first,
                "minus": name,
                "by_kind": _by_kind(grid, found[first].by_kind() - kept.by_kind()),
            }
            for name, kept in found.items()
            if name != first
        ],
    }


def worst_robot(grid: Grid, kept: Retention, kind: int, onset: int = 0) -> tuple[str, Estimate]:
    """The robot whose fault of a kind, at the last severity, costs most; and what is kept then."""
    row = kept.cells[kind, -1, :, onset]
    robot = int(row.value.argmin())
    return grid.scenario.robots[robot].name, row[robot].estimate()


def number(estimate: Estimate) -> dict[str, float | int | None] | None:
    """An estimate as a JSON object; None where it, or an end of its interval, is not defined."""
    defined = estimate.bounded and math.isfinite(estimate.mean)
    return estimate.to_json() if defined else None


def _policy(grid: Grid, kept: Retention) -> dict[str, Any]:
    return {
        "rescues_per_episode": number(kept.clean.estimate()),
        "by_kind": _by_kind(grid, kept.by_kind()),
        "worst": [
            {"kind": kind, "onset": onset, "robot": worst[0], "retention": number(worst[1])}
            for k, kind in enumerate(grid.kinds)
            for o, onset in enumerate(ONSETS)
            for worst in [worst_robot(grid, kept, k, o)]
        ],
        "after_onset": {
            kind: {
                "early": number(kept.early.mean((1, 2))[k].estimate()),
                "late": number(kept.late.mean((1, 2))[k].estimate()),
                "late_minus_early": number((kept.late - kept.early).mean((1, 2))[k].estimate()),
            }
            for k, kind in enumerate(grid.kinds)
        },
        "areas": [
            {"kind": kind, "robot": robot.name, "onset": onset, "area": number(area)}
            for k, kind in enumerate(grid.kinds)
            for r, robot in enumerate(grid.scenario.robots)
            for o, onset in enumerate(ONSETS)
            for area in [kept.areas[k, r, o].estimate()]
        ],
        "cells": [
            {
                "kind": kind,
                "severity": severity,
                "value": fault_of(grid.scenario, r, kind, severity).value,
                "robot": robot.name,
                "onset": onset,
                "retention": number(kept.cells[k, s, r, o].estimate()),
            }
            for k, kind in enumerate(grid.kinds)
            for s, severity in enumerate(grid.severities)
            for r, robot in enumerate(grid.scenario.robots)
            for o, onset in enumerate(ONSETS)
        ],
    }


def _by_kind(grid: Grid, estimate: Resampled) -> dict[str, Any]:
    each = {kind: number(estimate[k].estimate()) for k, kind in enumerate(grid.kinds)}
    return {**each, "all": number(estimate.mean(0).estimate())}
