"""The programs of examples/libraries: options, requirements, scores; and the one without a library.

`make examples` runs the others, each in its own environment.
"""

import ast
import json
import os
import re
import subprocess
import sys
from argparse import Namespace
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from innerattn.config import Scenario
from innerattn.envs import BatchEnv
from innerattn.evaluate.play import run_episodes
from innerattn.policies import scripted_policy

EXAMPLES = Path(__file__).parents[2] / "examples"
LIBRARIES = EXAMPLES / "libraries"
PROGRAMS = sorted(path for path in LIBRARIES.glob("*.py") if path.name != "scoring.py")
sys.path += [str(EXAMPLES), str(LIBRARIES)]

import run_all  # noqa: E402
import scoring  # noqa: E402
import single_file_mappo  # noqa: E402


def test_every_program_is_run_and_has_requirements() -> None:
    names = {path.stem for path in PROGRAMS}
    assert {example.program for example in run_all.EXAMPLES.values()} == names
    assert {path.stem for path in (LIBRARIES / "requirements").glob("*.txt")} == names


@pytest.mark.parametrize("program", PROGRAMS, ids=lambda path: path.stem)
def test_a_program_compiles_and_pins_what_it_imports(program: Path) -> None:
    tree = ast.parse(program.read_text("utf-8"))
    compile(tree, str(program), "exec")
    assert ast.get_docstring(tree)
    lines = (LIBRARIES / "requirements" / f"{program.stem}.txt").read_text("utf-8").splitlines()
    pins = [re.fullmatch(r"([\w-]+)(?:\[\w+\])?==[\w.]+", line) for line in lines]
    assert all(pins), lines
    pinned = {one[1].lower().replace("-", "_") for one in pins if one}
    imported = {
        name.partition(".")[0]
        for node in ast.walk(tree)
        for name in (
            [one.name for one in node.names]
            if isinstance(node, ast.Import)
            else [node.module or ""]
            if isinstance(node, ast.ImportFrom)
            else []
        )
    }
    ours = {"innerattn", "scoring"} | set(sys.stdlib_module_names)
    assert imported - ours <= pinned


def test_options_parse() -> None:
    trials = {"type": int, "default": 4}
    given = scoring.options("a", 10, ["--env-steps", "7", "--seed", "3"], trials=trials)
    assert vars(given) == {"env_steps": 7, "situation": "mixed", "seed": 3, "trials": 4}
    assert scoring.options("a", 10, []).env_steps == 10
    with pytest.raises(SystemExit):
        scoring.options("a", 10, ["--env-step", "many"])


@pytest.mark.parametrize("script", ["random", "hungarian"])
def test_a_script_is_scored_as_evaluation_counts_it(script: str) -> None:
    scenario = Scenario.preset("mixed").replace(episode_steps=25)
    policy = scripted_policy(script, scenario)
    record = run_episodes(policy, scenario, scoring.EPISODES, scoring.SEED)
    expected = len(record.rescues) / scoring.EPISODES
    assert scoring.scripted(scenario, script) == pytest.approx(expected)


def test_random_actions_score_zero_and_standing_still_less(
    capsys: pytest.CaptureFixture[str],
) -> None:
    source = np.random.default_rng(1)
    given = Namespace(situation="mixed", seed=0)

    def randomly(obs: NDArray[np.float32]) -> NDArray[np.int64]:
        return source.integers(5, size=obs.shape[:2])

    found = scoring.report("a", "b", given, 5, scoring.Spent(1.25, 2.0), randomly)
    assert found == json.loads(capsys.readouterr().out)
    assert abs(found["score"]) < 0.05
    assert (found["train_seconds"], found["train_cpu_seconds"]) == (1.2, 2.0)
    spent = scoring.Stopwatch().stop()
    still = scoring.report("a", "b", given, 5, spent, lambda obs: np.zeros(obs.shape[:2], int))
    assert still["rescues_per_episode"] < found["rescues_per_episode"]


@pytest.mark.long
def test_the_single_file_learns() -> None:
    done = subprocess.run(
        [sys.executable, str(LIBRARIES / "single_file_mappo.py"), "--env-steps", "60000"],
        capture_output=True,
        text=True,
        check=True,
    )
    result = json.loads(done.stdout)
    assert 60_000 <= result["env_steps"] < 70_000
    assert result["score"] > 0.1


def test_the_single_file_bootstraps_at_the_end_of_an_episode() -> None:
    import torch

    torch.manual_seed(0)
    worlds, steps = single_file_mappo.WORLDS, single_file_mappo.STEPS
    scenario = Scenario.preset("single").replace(episode_steps=7)
    team = single_file_mappo.Team(4, BatchEnv(scenario, 1).obs_width, 5)
    with BatchEnv(scenario, worlds, seed=2, copy=False) as env:
        rollout, _ = single_file_mappo.collect(env, team, np.array(env.reset()))
    actions = rollout.actions.view(steps, worlds, 4)
    gamma, decay = single_file_mappo.GAMMA, single_file_mappo.LAMBDA
    with BatchEnv(scenario, worlds, seed=2) as env, torch.no_grad():
        obs, deltas, ends = torch.from_numpy(env.reset()), [], []
        for t in range(steps):
            step = env.step(actions[t].numpy())
            after = team.value(torch.from_numpy(step.final_obs))
            after[step.terminated] = 0.0
            deltas.append(torch.from_numpy(step.reward) + gamma * after - team.value(obs))
            ends.append(torch.from_numpy(step.terminated | step.truncated))
            obs = torch.from_numpy(step.obs)
    assert torch.stack(ends).any()
    advantage = rollout.advantage.view(steps, worlds, 4)
    for world in (0, worlds - 1):
        for start in range(steps):
            total, weight = torch.zeros(4), 1.0
            for t in range(start, steps):
                total += weight * deltas[t][world]
                weight *= gamma * decay
                if ends[t][world]:
                    break
            torch.testing.assert_close(advantage[start, world], total, rtol=1e-4, atol=1e-5)


def test_the_table_of_baselines(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import baselines

    page = tmp_path / "docs.md"
    page.write_text("<!-- baselines: begin -->\n<!-- baselines: end -->\n", "utf-8")
    monkeypatch.setattr(baselines, "PAGE", page)
    monkeypatch.setattr(baselines, "KNOWN", tmp_path / "runs" / "known.jsonl")
    monkeypatch.setattr(baselines, "script", lambda *_: 0.875)
    assert baselines.known() == {}

    def row(score: float, seed: int) -> dict[str, float]:
        return {"score": score, "train_seconds": 10.0 + seed, "train_cpu_seconds": 5.0}

    rows = {("torchrl-mappo", "mixed", seed, 100): row(seed / 4, seed) for seed in range(3)}
    rows |= {("rllib-ppo", "single", seed, 100): row(0.5, seed) for seed in range(2)}
    rows |= {("rllib-ppo", "mixed", 0, 7): row(1.0, 0)}  # another length: not in this table
    baselines.remember(rows)
    assert baselines.known() == rows
    for _ in range(2):  # the second time the part is filled
        baselines.publish(rows, 100, 2)
    lines = page.read_text("utf-8").splitlines()
    first = "| `rllib-ppo` | 0.50 (0.50 to 0.50, 2 of 3 seeds) | not run | not run | 5 |"
    second = "| `torchrl-mappo` | not run | not run | 0.25 (0.00 to 0.50) | 5 |"
    assert lines[2] == "Over the three situations the script `greedy` scores 0.88."
    assert lines[6:8] == [first, second]
    assert lines[-5] == "| the script `greedy` | 0.88 | 0.88 | 0.88 |  |"
    assert sum("not run | not run | not run" in line for line in lines) == 9
    assert "seeds (0, 1, 2). 100 env-steps each" in lines[-3]
    assert "2 trainings at a time" in lines[-3]
    known = enumerate(("ppo-inner", "mappo", "td-inner", "xuance-mappo"))
    rows = {
        (name, situation, 0, 100): row(place / 4, 0)
        for place, name in known
        for situation in baselines.SITUATIONS
    }
    assert baselines.summary(rows, 100) == (
        "Over the three situations the best are `xuance-mappo` with 0.75, `td-inner` with 0.50 and "
        "`mappo` with 0.25; the script `greedy` scores 0.88."
    )


def test_what_the_page_compares_was_trained_equally_long() -> None:
    import baselines

    rows = {key: row for key, row in baselines.known().items() if key[3] == baselines.ENV_STEPS}
    assert rows
    for (name, situation, seed, env_steps), row in rows.items():
        told = (row["situation"], row["seed"], row["env_steps"])
        assert told == (situation, seed, env_steps), name


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="cores cannot be chosen here")
def test_trainings_side_by_side_have_a_core_each(monkeypatch: pytest.MonkeyPatch) -> None:
    import baselines

    before = os.sched_getaffinity(0)
    seen = []

    def trains(*_: object) -> dict[str, object]:
        seen.append(os.sched_getaffinity(0))
        return {}

    monkeypatch.setattr(baselines, "run", trains)
    cores = baselines.chosen_cores(len(before))
    with ThreadPoolExecutor(1) as pool:
        for seed in range(len(before)):
            key = ("torchrl-mappo", "mixed", seed, 100)
            pool.submit(baselines.trained, key, cores).result()
    assert sorted(map(sorted, seen)) == [[core] for core in sorted(before)]
    assert os.sched_getaffinity(0) == before


def test_greedy_lies_between_random_and_hungarian() -> None:
    import baselines

    assert baselines.script("random", "double") == 0.0
    assert 0.2 < baselines.script("greedy", "double") < 1.0
