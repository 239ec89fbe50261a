"""Retention of policies under faults as one document; it runs nothing and prints nothing."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from innerattn.evaluate.faults.grid import ONSETS, Grid, Retention
from innerattn.evaluate.faults.severity import fault_of
from innerattn.stats import Estimate
from innerattn.stats.bootstrap import Resampled

SCHEMA_VERSION = 1


def robustness_document(
    grid: Grid, policies: Mapping[str, Retention], runs: Mapping[str, str]
) -> dict[str, Any]:
    """What `robustness --json` holds about retention.

    Args:
        grid: the faults.
        policies: retention by policy; the others are compared with the first one.
        runs: training method by name, of those policies that are trained.
    """
    first = next(iter(policies))
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
            {"policy": name, "method": runs.get(name, name), **_policy(grid, one)}
            for name, one in policies.items()
        ],
        "differences": [
            {
                "policy": first,
                "minus": name,
                "by_kind": _by_kind(grid, policies[first].by_kind() - one.by_kind()),
            }
            for name, one in policies.items()
            if name != first
        ],
    }


def worst_robot(grid: Grid, retained: Retention, kind: int, onset: int = 0) -> tuple[str, Estimate]:
    """The robot whose fault of a kind, at the last severity, costs most; and the retention then."""
    row = retained.cells[kind, -1, :, onset]
    robot = int(row.value.argmin())
    return grid.scenario.robots[robot].name, row[robot].estimate()


def number(estimate: Estimate) -> dict[str, float | int | None] | None:
    """An estimate as a JSON object; None where it, or an end of its interval, is not defined."""
    defined = estimate.bounded and math.isfinite(estimate.mean)
    return estimate.to_json() if defined else None


def _policy(grid: Grid, retained: Retention) -> dict[str, Any]:
    early, late = retained.early, retained.late
    change = (late.retention - early.retention).mean((1, 2))
    since_onset = (retained.start, retained.middle)
    return {
        "rescues_per_episode": number(retained.clean.estimate()),
        "rescues_with_fault": _by_kind(grid, retained.rescues_by_kind),
        "by_kind": _by_kind(grid, retained.by_kind()),
        "worst": [
            {"kind": kind, "onset": onset, "robot": worst[0], "retention": number(worst[1])}
            for k, kind in enumerate(grid.kinds)
            for o, onset in enumerate(ONSETS)
            for worst in [worst_robot(grid, retained, k, o)]
        ],
        "after_onset": {
            kind: {
                "early": number(early.retention.mean((1, 2))[k].estimate()),
                "late": number(late.retention.mean((1, 2))[k].estimate()),
                "late_minus_early": number(change[k].estimate()),
                "early_rescues": number(early.rescues.mean((1, 2))[k].estimate()),
                "late_rescues": number(late.rescues.mean((1, 2))[k].estimate()),
            }
            for k, kind in enumerate(grid.kinds)
        },
        "after_onset_without_fault": {
            "early_rescues": number(early.clean.estimate()),
            "late_rescues": number(late.clean.estimate()),
        },
        "areas": [
            {"kind": kind, "robot": robot.name, "onset": onset, "area": number(area)}
            for k, kind in enumerate(grid.kinds)
            for r, robot in enumerate(grid.scenario.robots)
            for o, onset in enumerate(ONSETS)
            for area in [retained.areas[k, r, o].estimate()]
        ],
        "cells": [
            {
                "kind": kind,
                "severity": severity,
                "value": fault_of(grid.scenario, r, kind, severity).value,
                "robot": robot.name,
                "onset": onset,
                "rescues": number(since_onset[o].rescues[k, s, r].estimate()),
                "retention": number(retained.cells[k, s, r, o].estimate()),
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
