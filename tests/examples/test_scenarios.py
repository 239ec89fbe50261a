"""The worked scenarios: each is valid, is played by a script, and its command trains in it."""

import shlex
from pathlib import Path

import pytest

from innerattn.config import Scenario, load_run_config
from innerattn.envs import BatchEnv
from innerattn.evaluate import run_episodes, scripted_policy
from innerattn.train.build import build_learner

ROOT = Path(__file__).parents[2]
FILES = sorted((ROOT / "examples" / "scenarios").glob("*.toml"))
EPISODES = 60
KEYS = {
    "--network.hidden-width": "network.hidden_width",
    "--network.message-width": "network.message_width",
    "--train.env-steps": "train.env_steps",
    "--network.symmetry": "network.symmetry",
    "--warm-start": "train.warm_start",
}


def test_there_are_ten() -> None:
    assert [file.stem for file in FILES] == [
        "assembly",
        "convoy",
        "drones",
        "fire",
        "flood",
        "lookout",
        "office",
        "rovers",
        "search",
        "warehouse",
    ]


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_a_script_rescues_in_it(file: Path) -> None:
    scenario = Scenario.from_toml(file)
    means = {
        name: run_episodes(scripted_policy(name, scenario, 5), scenario, EPISODES, 5, num_threads=1)
        .rescue_counts()
        .mean()
        for name in ("random", "planner")
    }
    assert means["planner"] > max(1.0, 5 * means["random"])


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_the_command_in_the_file_can_train(file: Path) -> None:
    comment = " ".join(
        line.removeprefix("#").strip().removesuffix("\\")
        for line in file.read_text("utf-8").splitlines()
        if line.startswith("#   ")
    )
    words = shlex.split(comment)
    assert words[:4] == ["innerattn", "train", "--scenario", f"examples/scenarios/{file.name}"]
    options = dict(zip(words[4::2], words[5::2], strict=True))
    overrides = {"network.hidden_width": 16, "train.threads": 1}
    for option, key in KEYS.items():
        if option in options:
            value = options[option]
            overrides[key] = int(value) if value.isdigit() else value
    config = load_run_config(
        method=options["--method"],
        budget=options["--budget"],
        overrides=overrides,
        scenario_file=file,
    )
    env = BatchEnv(config.training_scenario, 2, num_threads=1)
    try:
        assert build_learner(config, env, training=True) is not None
    finally:
        env.close()
