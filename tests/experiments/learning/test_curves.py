"""Learning curves against plain loops over the lines of metrics."""

import json
from pathlib import Path

import numpy as np
import pytest

from innerattn.experiments.learning.curves import PARTS, SCRIPTS, in_parts, learning_curves
from innerattn.experiments.plan import Case
from innerattn.experiments.run import FinishedRun, read_run


@pytest.mark.parametrize("seed", range(5))
def test_means_over_parts_are_those_of_a_plain_loop(seed: int) -> None:
    rng = np.random.default_rng(seed)
    steps = np.sort(rng.choice(np.arange(1, 200), 30, replace=False)).astype(np.float64)
    values = rng.random(30)
    edges = np.linspace(0.0, rng.choice([steps[-1], steps[-3]]), 9)
    found = in_parts(steps, values, edges)
    for part in range(8):
        low, high = edges[part], edges[part + 1]
        last = part == 7
        own = [
            value
            for step, value in zip(steps, values, strict=True)
            if low < step and (last or step <= high)
        ]
        if own:
            assert found[part] == pytest.approx(sum(own) / len(own))
        else:
            assert np.isnan(found[part])


def test_a_curve_is_the_mean_over_runs(runs: list[FinishedRun]) -> None:
    own = [run for run in runs if run.method == "td-inner"]
    (curve,) = learning_curves([own])
    assert (curve.situation, curve.method) == ("mixed", "td-inner")
    assert len(curve.env_steps) == PARTS
    width = 1200 / PARTS
    logged = [
        [json.loads(line) for line in (run.folder / "metrics.jsonl").read_text().splitlines()]
        for run in own
    ]
    for lines in zip(*logged, strict=True):
        part = int(np.ceil(lines[0]["env_steps"] / width)) - 1
        values = [line["rescues_per_episode"] for line in lines]
        if values[0] is None:
            assert np.isnan(curve.rescues.mean[part])
        else:
            assert curve.env_steps[part] == pytest.approx((part + 0.5) * width)
            assert curve.rescues.mean[part] == pytest.approx(np.mean(values))
    scripted = own[0].summary["scripted"]
    assert curve.scripts == {name: scripted[name]["mean"] for name in SCRIPTS}


def test_runs_in_which_no_episode_ended_have_no_curve(finished_study: Path) -> None:
    folder = finished_study / "runs" / "mixed-td-inner-quick-s0"
    assert learning_curves([[read_run(Case("mixed", "td-inner", 0), folder)]]) == []
