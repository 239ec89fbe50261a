"""`innerattn train`: options become the run's configuration, and a run ends with its evaluation."""

import json
import os
import re
import sys
import tomllib
from pathlib import Path

import pytest
import torch
from in_turn import do_in_turn

from innerattn.cli.main import main
from innerattn.config import RunConfig, Scenario, load_run_config, read_toml
from innerattn.errors import RunError
from innerattn.learn import TD


def test_a_run_is_complete(run_dir: Path) -> None:
    assert json.loads((run_dir / "run.json").read_text())["state"] == "done"
    names = {file.name for file in (run_dir / "evaluation").iterdir()}
    assert names == {"episodes.parquet", "rescues.parquet", "summary.json"}
    lines = [json.loads(line) for line in (run_dir / "metrics.jsonl").read_text().splitlines()]
    assert [line["env_steps"] for line in lines] == [104, 200, 304, 400]


def test_options_reach_the_run(run_dir: Path) -> None:
    config = read_toml(run_dir / "config.toml")
    expected = load_run_config(
        overrides={
            "train.seed": 3,
            "train.env_steps": 400,
            "train.num_envs": 8,
            "train.threads": 1,
            "train.log_every_env_steps": 100,
            "td.warmup_env_steps": 64,
            "td.batch_size": 32,
            "network.hidden_width": 16,
            "network.attention_heads": 2,
            "evaluate.episodes": 4,
            "evaluate.score_episodes": 6,
            "evaluate.long_episodes": 2,
            "evaluate.long_episode_steps": 30,
        }
    )
    assert config == expected


def test_a_warm_start_is_reported_apart(
    tmp_path: Path, tiny: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    warm = ["--warm-start", "hungarian", "--imitation.env-steps", "200", "--imitation.batch-size"]
    path = tmp_path / "run"
    assert main(["train", "--run-dir", str(path), *tiny, *warm, "32"]) == 0
    printed = capsys.readouterr().out
    assert "Imitating hungarian first: 200 env-steps" in printed
    assert "td-inner was warm-started from hungarian" in printed
    assert json.loads((path / "run.json").read_text())["warm_start"] == "hungarian"
    assert json.loads((path / "evaluation" / "summary.json").read_text())["warm_start"] == (
        "hungarian"
    )
    assert tomllib.loads((path / "config.toml").read_text())["train"]["warm_start"] == "hungarian"


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[tuple[RunConfig, Path]]:
    """What training was asked for; it is noted, and not done."""
    calls: list[tuple[RunConfig, Path]] = []

    def note(config: RunConfig, run_dir: Path, **_: object) -> None:
        calls.append((config, run_dir))
        raise RunError("not done")

    monkeypatch.setattr("innerattn.train.train", note)
    return calls


def config_of(asked: list[tuple[RunConfig, Path]], *options: str) -> tuple[RunConfig, Path]:
    assert main(["train", *options]) == 1
    return asked.pop()


def test_defaults(asked: list[tuple[RunConfig, Path]]) -> None:
    config, run_dir = config_of(asked)
    assert config == load_run_config("mixed", "td-inner", "quick")
    assert re.fullmatch(r"runs/mixed-td-inner-quick-s0-\d{8}-\d{6}", run_dir.as_posix())


def test_the_name_of_a_run_tells_its_warm_start(asked: list[tuple[RunConfig, Path]]) -> None:
    config, run_dir = config_of(asked, "--method", "ppo-inner", "--warm-start", "greedy")
    given = {"train.warm_start": "greedy"}
    assert config == load_run_config(method="ppo-inner", overrides=given)
    assert config.train.warm_start == "greedy"
    assert run_dir.name.startswith("mixed-ppo-inner-from-greedy-quick-s0-")


def test_sources_and_their_order(asked: list[tuple[RunConfig, Path]], tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text(
        "[train]\nmethod = 'td-uniform'\nseed = 4\n[td]\ngamma = 0.5\nbatch_size = 9\n"
        "[[scenario.tasks]]\nname = 'only'\nneeds = ['food', 'food']\n"
    )
    options = ["--preset", "double", "--budget", "paper", "--config", str(file)]
    config, run_dir = config_of(asked, *options, "--td.batch_size", "10", "--seed", "5")
    assert (config.td.learning_rate, config.td.gamma, config.td.batch_size) == (0.001, 0.5, 10)
    assert (config.train.method, config.network.attention) == ("td-uniform", "uniform")
    assert [task.name for task in config.scenario.tasks] == ["only"]
    assert run_dir.name.startswith("double-td-uniform-paper-s5-")
    config, _ = config_of(asked, *options, "--method", "td-inner")
    assert (config.train.method, config.network.attention) == ("td-inner", "inner")


@pytest.mark.parametrize("head", ["", "[scenario]\n"])
def test_a_scenario_of_ones_own(
    asked: list[tuple[RunConfig, Path]], tmp_path: Path, head: str
) -> None:
    file = tmp_path / "flood.toml"
    file.write_text(f"{head}situation = 'double'\nepisode_steps = 40\n")
    options = ["--scenario", str(file), "--method", "ppo-inner"]
    config, run_dir = config_of(asked, *options, "--scenario.dt-s", "0.2")
    assert config.scenario == Scenario(situation="double", episode_steps=40, dt_s=0.2)
    assert run_dir.name.startswith("flood-ppo-inner-quick-s0-")


@pytest.mark.parametrize(
    ("options", "key", "value"),
    [
        (["--train.method", "td-uniform"], "train.method", "td-uniform"),
        (["--train.seed", "7"], "train.seed", 7),
        (["--train.device", "cpu:0"], "train.device", "cpu:0"),
        (["--train.threads", "2"], "train.threads", 2),
        (["--scenario.end-when-rescued", "2"], "scenario.end_when_rescued", 2),
        (["--scenario.rescue-credit", "team"], "scenario.rescue_credit", "team"),
        (["--network.mask-unavailable"], "network.mask_unavailable", True),
        (["--td.learning_rate=1e-4"], "td.learning_rate", 1e-4),
        (["--evaluate.no-greedy-actions"], "evaluate.greedy_actions", False),
    ],
)
def test_single_options(
    asked: list[tuple[RunConfig, Path]], options: list[str], key: str, value: object
) -> None:
    config, _ = config_of(asked, *options)
    section, name = key.split(".")
    assert getattr(getattr(config, section), name) == value


def test_every_key_is_an_option(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["train", "--help-all"])
    text = capsys.readouterr().out.replace("_", "-")
    lists = ("robots", "tasks", "obstacles", "stations", "depots", "faults", "arrivals")
    in_a_file = {f"scenario.{name}" for name in lists}
    in_a_file |= {"scenario.map", "scenario.communication", "train.schedule"}
    for section, table in load_run_config().model_dump().items():
        for key in table or ():  # a family has a file of its own
            offered = f"--{section}.{key.replace('_', '-')} " in text.replace(",", " ")
            assert offered != (f"{section}.{key}" in in_a_file), f"{section}.{key}"


def test_help_shows_the_chosen_defaults(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["train", "--budget", "paper", "--help"])
    assert "(625,000)" in capsys.readouterr().out
    with pytest.raises(SystemExit):
        main(["train", "--budget", "paper", "--help-all"])
    assert "(default: 625000)" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("options", "code", "message"),
    [
        (["--td.gamma", "2"], 2, "td.gamma = 2.0: must be less than or equal to 1"),
        (["--network.attention", "uniform"], 2, "network.attention = 'uniform': train.method"),
        (["--scenario.episode-steps", "0"], 2, "scenario.episode_steps = 0: must be"),
        (["--config", "none.toml"], 1, "cannot read none.toml"),
        (["--scenario", "none.toml"], 1, "cannot read none.toml"),
        (["--device", "gpu"], 1, "train.device = 'gpu': not usable here, must be 'cpu'"),
        (["--run-dir", "."], 1, ".: exists already"),
        (["--td.batch-size", "9", "--td.replay-capacity", "8"], 2, "td.replay_capacity = 8: must"),
        (
            ["--scenario.actions", "continuous"],
            2,
            "scenario.actions = 'continuous': train.method = 'td-inner' learns 'discrete' actions "
            "only; methods for continuous ones are ppo-inner, ppo-uniform",
        ),
    ],
)
def test_what_cannot_be_run_is_one_line(
    options: list[str],
    code: int,
    message: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["train", *options]) == code
    out, err = capsys.readouterr()
    assert out == ""  # nothing is announced that does not begin
    assert err.startswith(f"innerattn: error: {message}")
    assert err.count("\n") == 1
    assert list(tmp_path.glob("runs/*")) == []


def test_divergence_is_one_line(
    tmp_path: Path, tiny: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "run"
    assert main(["train", "--run-dir", str(path), *tiny, "--td.reward-scale", "1e-37"]) == 1
    err = capsys.readouterr().err
    assert err.startswith("innerattn: error: training diverged at env_steps = ")
    assert err.endswith(": losses.critic_loss = inf: must be finite\n")
    assert err.count("\n") == 1
    assert json.loads((path / "run.json").read_text())["state"] == "interrupted"


@pytest.mark.parametrize(
    "options",
    [
        ["--td.replay-capacity", str(10**9)],
        [
            *("--warm-start", "hungarian"),
            *("--imitation.env-steps", str(10**12), "--imitation.memory-env-steps", str(10**9)),
        ],
    ],
)
def test_what_memory_cannot_hold_is_one_line(
    options: list[str], tiny: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["train", "--run-dir", str(tmp_path / "run"), *tiny, *options]) == 1
    assert not (tmp_path / "run").exists()
    err = capsys.readouterr().err
    key = options[-2].removeprefix("--").replace("-", "_")
    assert err.startswith(f"innerattn: error: out of memory: {key} = 1000000000: Unable to ")
    assert err.count("\n") == 1


def test_what_torch_cannot_hold_is_one_line_too(
    tiny: list[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def fail(*_: object) -> None:
        torch.empty(2**58)

    monkeypatch.setattr(TD, "update", fail)
    assert main(["train", "--run-dir", str(tmp_path / "run"), *tiny]) == 1
    err = capsys.readouterr().err
    assert err.startswith("innerattn: error: out of memory: ")
    assert err.count("\n") == 1
    monkeypatch.setattr(TD, "update", lambda *_: torch.zeros(2) + torch.zeros(3))
    with pytest.raises(RuntimeError, match="size of tensor"):  # a fault of ours is shown as one
        main(["train", "--run-dir", str(tmp_path / "other"), *tiny])


@pytest.mark.parametrize(
    ("option", "most"),
    [
        ("td.replay-capacity", 10**9),
        ("imitation.memory-env-steps", 10**9),
        ("train.env-steps", 10**15),
    ],
)
def test_counts_beyond_any_machine_are_refused(
    option: str, most: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "run"
    assert main(["train", "--run-dir", str(path), f"--{option}", str(most + 1)]) == 2
    err = capsys.readouterr().err
    assert f"{option.replace('-', '_')} = {most + 1}: must be less than or equal to {most}" in err
    assert not path.exists()


def test_a_run_without_an_update_says_so(
    tiny: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["train", "--run-dir", str(tmp_path / "run"), *tiny]) == 0
    assert "nothing was learnt" not in capsys.readouterr().err
    short = [*tiny, "--train.env-steps", "40"]
    assert main(["train", "--run-dir", str(tmp_path / "short"), *short]) == 0
    assert "short: 40 env-steps are too few for one update" in capsys.readouterr().err


@pytest.mark.skipif(sys.platform != "linux", reason="file names are not bytes everywhere")
def test_a_name_that_weights_cannot_have_is_refused_before_training(
    tiny: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = os.fsdecode(os.fsencode(tmp_path) + b"/run\xff")
    assert main(["train", "--run-dir", path, *tiny]) == 1
    assert "is no UTF-8" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_several_runs_need_a_name(tiny: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["train", "--seeds", "0", "--run-dir", "", *tiny]) == 2
    assert "--run-dir .: must end in a name" in capsys.readouterr().err


def test_existing_folder_is_refused(
    run_dir: Path, tiny: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    before = {file: file.stat().st_mtime_ns for file in run_dir.rglob("*")}
    assert main(["train", "--run-dir", str(run_dir), *tiny]) == 1
    assert f"innerattn: error: {run_dir}: exists already" in capsys.readouterr().err
    assert {file: file.stat().st_mtime_ns for file in run_dir.rglob("*")} == before


@pytest.mark.parametrize("rises", [pytest.param(False, marks=pytest.mark.long), True])
def test_the_score_is_the_last_thing_on_the_screen(
    rises: bool,
    tiny: list[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr("innerattn.cli.train.still_rises", lambda _: rises)
    more = "train longer with --train.env-steps 800"
    assert main(["train", "--run-dir", str(tmp_path / "one"), *tiny]) == 0
    *_, before, last = capsys.readouterr().out.splitlines()
    score = r"\S+ (± \S+ )?rescues per episode of 25 steps, score \S+"
    assert re.match(score, last)
    hint = f"Rescues still rose at the end: {more}"
    assert before == hint if rises else before.startswith("Watch it in a browser: ")
    monkeypatch.setattr("innerattn.cli.train.run_side_by_side", do_in_turn)
    assert main(["train", "--seeds", "0..1", "--run-dir", str(tmp_path / "two"), *tiny]) == 0
    *_, before, last = capsys.readouterr().out.splitlines()
    assert re.match(f"{score}.*, mean of 2 of 2 seeds", last)
    hint = f"Rescues still rose in 2 of 2 runs: {more}"
    assert before == hint if rises else before.endswith("two-s1 (done)")
