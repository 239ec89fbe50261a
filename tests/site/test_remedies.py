"""Remedies that the page of messages names do what the page says."""

import re
import shutil
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from innerattn.cli.main import main
from innerattn.config import RunConfig, Scenario, load_run_config
from innerattn.errors import EXTRA_OF, ExportError
from innerattn.policies import Exported
from innerattn.records.run_folder import newest_weights
from innerattn.train import load_policy
from innerattn.train.checkpoint_info import Best
from innerattn.train.saved import best_name
from innerattn.zoo import read_card, zoo_names

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
sys.path.insert(0, str(DOCS))
from reference_directives import range_of  # noqa: E402

QUOTED = re.findall(r"(?m)^\*\*`(.+?)`\*\* —", (DOCS / "faq.md").read_text("utf-8"))
ROBOT = """
[[robots]]
name = "{0}"
kind = "{0}"
abilities = [{1}]
max_speed_mps = 1.0
mass_kg = 1.0
"""
TASK = '\n[[tasks]]\nname = "x"\nneeds = [{}]\n'
FEW = [
    *("--episodes", "2", "--score-episodes", "2", "--episode-steps", "20"),
    *("--long-episodes", "2", "--long-episode-steps", "30"),
]
Words = Callable[[Path, list[str]], list[str]]


def scenario(*parts: str) -> list[str]:
    Path("mine.toml").write_text("".join(parts))
    return ["info", "--scenario", "mine.toml"]


def runs(run: Path, *names: str) -> None:
    for name in names:
        shutil.copytree(run, Path("runs") / name)


def evaluate_one(run: Path, word: str) -> list[str]:
    runs(run, "mixed-a", "mixed-b")
    return ["evaluate", word, *FEW]


BOTH = ROBOT.format("a", '"water"') + ROBOT.format("b", '"water"')
FIXED: dict[str, Words] = {
    "train.device = 'gpu': not usable here": lambda _, tiny: [
        *("train", "--device", "cpu", "--run-dir", "new", *tiny),
    ],
    "exists already; choose another run folder or remove it": lambda _, tiny: [
        *("train", "--run-dir", "another", *tiny),
    ],
    "scenario.situaton: unknown key, did you mean situation?": lambda *_: scenario(
        'situation = "double"\n'
    ),
    "task 'x' needs 'water', which no robot of the team can do": lambda *_: scenario(
        ROBOT.format("a", '"water"'), TASK.format('"water"')
    ),
    "scenario.tasks[0].needs = water + water: the team has no distinct able robot for each need": (
        lambda *_: scenario(BOTH, TASK.format('"water", "water"'))
    ),
    "cannot read mine.toml: No such file or directory": lambda *_: scenario(
        'situation = "double"\n'
    ),
    "train.method = 'td-inner' learns 'discrete' actions only": lambda _, tiny: [
        *("train", "--run-dir", "new", *tiny, "--method", "ppo-inner"),
        *("--scenario.actions", "continuous"),
    ],
    "neither a run's folder nor one of random, greedy, hungarian": lambda run, _: evaluate_one(
        run, "mixed-a"
    ),
    "latest: no run is in runs yet": lambda run, _: ["evaluate", str(run), *FEW],
    "2 runs in runs begin so": lambda run, _: evaluate_one(run, "mixed-b"),
    "a team of the package has no metrics for a report": lambda *_: [
        *("evaluate", "zoo:mixed", *FEW),
    ],
    "-o FOLDER must say where to write": lambda *_: ["export", "zoo:mixed", "-o", "out"],
    "too few for one update; nothing was learnt from rewards": lambda _, tiny: [
        *("train", "--run-dir", "new", *tiny, "--train.env-steps", "400"),
    ],
}


@pytest.mark.long
@pytest.mark.parametrize("message", FIXED)
def test_the_command_that_the_page_advises(
    message: str,
    run_dir: Path,
    tiny: list[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    code = main(FIXED[message](run_dir, tiny))
    assert (code, message in capsys.readouterr().err) == (0, False)


@pytest.mark.parametrize(
    ("words", "named"),
    [(["train", "--help-all"], "--seed"), (["--help"], "train")],
)
def test_the_help_lists_what_was_misspelt(
    words: list[str], named: str, capsys: pytest.CaptureFixture[str]
) -> None:
    try:
        code: object = main(words)
    except SystemExit as end:
        code = end.code
    assert not code
    assert re.search(rf"(?m)^.*(?<![\w.-]){named}\b", capsys.readouterr().out)


def test_names_of_gpus_are_valid() -> None:
    for name in ("cuda", "cuda:0"):
        config = load_run_config("mixed", overrides={"train.device": name})
        assert config.train.device == name


def test_readings_that_are_mended(plain_team: Path) -> None:
    folder = plain_team / "export"
    team = Exported(folder, backend="numpy")
    body = {"position": (0.0, 0.0), "velocity": (0.0, 0.0)}
    others = dict.fromkeys(team.robot_names[1:], None)
    readings = {"own": body, "teammates": others, "victims": []}
    team.decide("food_0", readings)  # None: not heard
    timed = {**readings, "own": {**body, "time": 1.0}, "victims_time": 1.0, "now": 1.5}
    Exported(folder, backend="numpy", max_age_s=1.0).decide("food_0", timed)
    row = team.row("food_0", readings)
    assert np.asarray(row).shape == (44,)
    team.decide("food_0", row)


def test_the_range_of_each_number_is_on_the_page_of_keys() -> None:
    keys = RunConfig.model_json_schema()["$defs"]["TDConfig"]["properties"]
    assert range_of(keys["gamma"]) == "0 to 1"
    assert load_run_config("mixed", overrides={"td.gamma": 1.0}).td.gamma == 1.0


def test_the_readme_lists_every_extra_that_a_message_names() -> None:
    readme = (DOCS.parent / "README.md").read_text("utf-8")
    listed = re.findall(r"(?m)^\| `(\w+)` \|", readme.partition("## Install without a clone")[2])
    assert set(EXTRA_OF.values()) <= set(listed)


@pytest.mark.parametrize("name", zoo_names())
def test_the_command_of_a_card_trains_a_team_of_the_package(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = []

    def remember(config: RunConfig, *_: object, **__: object) -> None:
        asked.append(config)
        raise KeyboardInterrupt

    monkeypatch.setattr("innerattn.train.train", remember)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "examples").symlink_to(ROOT / "examples")  # commands are for the project's root
    program, *words = read_card(name)["command"].split()
    assert program == "innerattn"
    assert main(words) == 130
    config, _ = load_policy(f"zoo:{name}")
    assert asked[0].scenario == config.scenario
    assert asked[0].train == config.train
    assert asked[0].digest() == config.digest()


@pytest.mark.slow
def test_a_team_with_a_file_of_another_is_exported_again(plain_team: Path, tmp_path: Path) -> None:
    run, folder = plain_team / "run", shutil.copytree(plain_team / "export", tmp_path / "export")
    shutil.copy(newest_weights(run), folder / "weights.safetensors")
    with pytest.raises(ExportError, match="is of another team"):
        Exported(folder, backend="numpy")
    assert main(["export", str(run), "-o", str(tmp_path / "again")]) == 0
    Exported(tmp_path / "again", backend="numpy")


def test_what_a_team_that_does_not_learn_is_advised_can_be_given() -> None:
    """Options with a value, keys of files, messages and files that the page names."""
    page = (DOCS / "not_learning.md").read_text("utf-8")
    given = {
        "train.env_steps": 400_000,
        "ppo.learning_rate": 0.001,
        "train.on_divergence": "skip",
        "network.parameter_sharing": "kind",
        "train.warm_start": "hungarian",
    }
    for key in given:
        option = "--" + key.replace("_", "-").replace("train.warm", "warm")
        assert option in page, option
        load_run_config("mixed", "ppo-inner", "fast", overrides={key: given[key]})
    assert Scenario.model_validate({"shaping": "progress"}).shaping == "progress"
    assert 'shaping = "progress"' in page
    assert "Rescues still rose at the end" in page
    source = (ROOT / "python/innerattn/cli/train.py").read_text("utf-8")
    assert "escues still rose at the end" in source
    assert best_name(Best(0.1, 5)) == "best-5.safetensors"
    assert "checkpoints/best-N.safetensors" in page


def test_every_remedy_of_the_page_is_tried() -> None:
    elsewhere = {
        "--sede: unknown option, did you mean --seed?",
        "trian: unknown command, did you mean train?",
        "teammates.food_1.position",
        "own.time: is 0.500 s before now: must be at most 0.3 s away",
        "own.heading: is unknown; known are available, faults, position, time, velocity",
        "row: has dtype float64 and shape (3,): must hold 44 numbers",
        "is not the file that manifest.json names; it was altered",  # tests/experiments/test_seal
        "has no manifest.json",  # tests/experiments/test_seal.py
        "training diverged",  # tests/train/test_divergence.py
        "Updates run uncompiled, which is slower",  # tests/train/test_compilation.py
        "td.gamma = 2.0: must be less than or equal to 1",
        "needs torch: pip install 'innerattn[train]'",
        "a team of the package is done, nothing to go on from",
        "is of another team",
    }
    assert set(QUOTED) == set(FIXED) | elsewhere
