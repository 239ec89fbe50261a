"""Learning curves against plain loops over the lines of metrics."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from reseal import reseal
from small_study import run_in

from innerattn.envs import BatchEnv
from innerattn.experiments.plan import Case
from innerattn.experiments.run import FinishedRun, read_run
from innerattn.policies import PolicyInput, WorldState, scripted_policy
from innerattn.studies.curves import (
    EPISODES,
    PARTS,
    SCRIPTS,
    LearningCurve,
    in_parts,
    learning_curves,
)


def curves_of(*runs: FinishedRun) -> list[LearningCurve]:
    return learning_curves([(runs[0].situation, runs[0].method, runs)])


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
    (curve,) = curves_of(*own)
    assert (curve.situation, curve.method) == ("mixed", "td-inner")
    courses, all_lines = [], []
    for run in own:
        lines = list(map(json.loads, (run.folder / "metrics.jsonl").read_text().splitlines()))
        all_lines.append(lines)
        courses.append([one for one in lines if one["rescues_per_episode"] is not None])
    parts = min(PARTS, 2 * min(map(len, courses)) // 3)
    width = min(lines[-1]["env_steps"] for lines in courses) / parts
    means = []
    for lines in courses:
        by_part: list[list[float]] = [[] for _ in range(parts)]
        for one in lines:
            part = min(int(np.ceil(one["env_steps"] / width - 1e-9)) - 1, parts - 1)
            by_part[part].append(one["rescues_per_episode"])
        means.append([np.mean(values) if values else np.nan for values in by_part])
    np.testing.assert_allclose(curve.env_steps, (np.arange(parts) + 0.5) * width)
    np.testing.assert_allclose(curve.rescues.mean, np.mean(means, axis=0))
    seconds = [
        np.interp(
            curve.env_steps,
            [0, *(one["env_steps"] for one in lines)],
            [0, *(one["seconds"] for one in lines)],
        )
        for lines in all_lines
    ]
    np.testing.assert_allclose(curve.seconds, np.mean(seconds, axis=0))
    scripted = own[0].summary["scripted"]
    assert curve.scripts == {name: scripted[name]["mean"] for name in SCRIPTS}


def test_scripts_play_episodes_as_long_as_those_of_training(runs: list[FinishedRun]) -> None:
    run = next(run for run in runs if run.method == "td-inner")
    train = run.config.train.replace(episode_steps=50, engine="discs")
    longer = replace(run, config=run.config.model_copy(update={"train": train}))
    (curve,) = curves_of(longer)
    scenario = run.config.scenario.replace(episode_steps=50, engine="discs")
    policy, rescues = scripted_policy("hungarian", scenario), 0
    with BatchEnv(scenario, EPISODES, seed=run.seed) as env:
        obs = env.reset()
        for _ in range(50):
            step = env.step(policy.act(PolicyInput(obs, WorldState.of(env))))
            obs, rescues = step.obs, rescues + len(step.rescues)
    assert curve.scripts["hungarian"] == rescues / EPISODES
    assert curve.scripts["hungarian"] > 1.5 * run.summary["scripted"]["hungarian"]["mean"]


def test_where_rescues_end_episodes_all_env_steps_count(
    runs: list[FinishedRun], tmp_path: Path
) -> None:
    """The episodes that ended are the lucky ones: the first has as many rescues as there can be."""
    run = next(run for run in runs if run.method == "td-inner")
    scenario = run.config.scenario.replace(end_when_rescued=2, engine="discs")
    lines = [
        {"env_steps": 100 * number, "seconds": 1.0, "rescues_per_episode": 2.0}
        | {"rescues_per_env_step": 0.01 * number}
        for number in range(1, 4)
    ]
    folder = Path(shutil.copytree(run.folder, tmp_path / "run"))
    (folder / "metrics.jsonl").write_text("".join(json.dumps(line) + "\n" for line in lines))
    reseal(folder)
    config = run.config.model_copy(update={"scenario": scenario})
    (curve,) = curves_of(replace(run, config=config, folder=folder))
    np.testing.assert_allclose(curve.env_steps, [75.0, 225.0])
    np.testing.assert_allclose(curve.rescues.mean, [0.25, 0.625])  # 25 steps of 0.01, 0.02 and 0.03
    assert curve.unit == f"{scenario.episode_steps} steps"
    assert curve.scripts["hungarian"] > 2.0  # an episode would have 2 at most


def test_runs_in_which_no_episode_ended_have_no_curve(finished_study: Path) -> None:
    run = read_run(Case("mixed", "td-inner", 0), run_in(finished_study, "td-inner"))
    assert curves_of(run) == []
