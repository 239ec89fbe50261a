"""What every command shares: one line for what is wrong, short help, quiet, completion."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from innerattn.cli.completion import SHELLS
from innerattn.cli.info import Info
from innerattn.cli.main import COMMANDS, main
from innerattn.cli.train import command_type
from innerattn.cli.usage import option_names

Captured = pytest.CaptureFixture[str]


def refused(capsys: Captured, *arguments: str) -> str:
    """The one line of a command that is written wrongly."""
    with pytest.raises(SystemExit) as caught:
        main(arguments)
    assert caught.value.code == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("innerattn: error: ")
    assert err.endswith("\n")
    assert err.count("\n") == 1
    return err.removeprefix("innerattn: error: ").rstrip()


def printed(capsys: Captured, *arguments: str) -> str:
    with pytest.raises(SystemExit) as caught:
        main(arguments)
    assert caught.value.code == 0
    return capsys.readouterr().out


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ("trian", "trian: unknown command, did you mean train?"),
        ("frobnicate", "frobnicate: unknown command; commands are demo, train, evaluate, "),
        ("--seed 1", "--seed: a command must come first: demo, train, evaluate, "),
        ("train --sede 1", "--sede: unknown option, did you mean --seed?"),
        ("train --train.sede 1", "--train.sede: unknown option, did you mean --train.seed?"),
        ("train --env-steps 9", "--env-steps: unknown option, did you mean --train.env-steps or"),
        ("train --frobnicate", "--frobnicate: unknown option; innerattn train --help-all lists"),
        ("train --preset mxied", "--preset mxied: must be air-ground, double, mixed, "),
        (
            "train --preset a.toml",
            "--preset a.toml: must be air-ground, double, mixed, mixed-1-food, mixed-16, "
            "mixed-4-food, mixed-8, mixed-faults, mixed-radio, mixed-sight, mixed-wheels, "
            "rescue-16, rescue-64 or single; --scenario reads a file",
        ),
        ("train --seed abc", "--seed abc: must be a whole number"),
        ("train --seed=abc", "--seed abc: must be a whole number"),
        ("train --seed", "--seed: needs a value: a whole number"),
        ("train --td.gamma high", "--td.gamma high: must be a number"),
        ("train --train.engine rapeir", "--train.engine rapeir: must be rapier or discs, did you"),
        ("train --log wandbb", "--log wandbb: must be tensorboard, wandb, mlflow or trackio, did"),
        ("train twice", "twice: is one word too many; innerattn train --help shows how"),
        ("evaluate", "RUN|POLICY: must be given; innerattn evaluate --help shows how"),
        ("evaluate --episods 3", "--episods: unknown option, did you mean --episodes?"),
        ("evaluate random --episodes x", "--episodes x: must be a whole number"),
        ("reproduce tabel2", "tabel2: must be table2, fig4, "),
        ("--completion bsh", "--completion bsh: must be one of bash, zsh, fish, did you mean ba"),
        ("--completion", "--completion: must be one of bash, zsh, fish"),
    ],
)
def test_wrong_words_are_one_line(line: str, told: str, capsys: Captured) -> None:
    assert refused(capsys, *line.split()).startswith(told)


@pytest.mark.parametrize(
    "line",
    [
        "train --preset mxied",
        "train --scenario.situation mxied",
        "evaluate random --situation mxied",
    ],
)
def test_the_nearest_value_is_named(line: str, capsys: Captured) -> None:
    assert refused(capsys, *line.split()).endswith(", did you mean mixed?")


def test_equal_faults_have_equal_codes(tmp_path: Path, capsys: Captured) -> None:
    wrong = tmp_path / "wrong.toml"
    wrong.write_text("situaton = 'mixed'\n")
    out_of_range = [
        "train --seed -1",
        "evaluate random --seed -1",
        "play random --seed -1",
        "page random --seed -1",
    ]
    out_of_range += ["replay random --seed -1", "robustness random --seed -1"]
    for line in out_of_range:
        assert main(line.split()) == 2, line
    scenario = ["train", "evaluate random", "play random", "page random", "replay random", "info"]
    missing = [f"{command} --scenario none.toml" for command in scenario]
    for line in missing:
        assert main(line.split()) == 1, line
    for command in scenario:
        assert main([*command.split(), "--scenario", str(wrong)]) == 1, command
    for command in ("evaluate", "replay", "report", "robustness", "watch", "play", "page"):
        assert main([command, "no-such-run"]) == 1, command
    err = capsys.readouterr().err
    assert err.count("\n") == len(out_of_range) + 2 * len(scenario) + 7
    assert err.count("did you mean situation?") == len(scenario)


@pytest.mark.parametrize("head", ["", "[scenario]\n"])
def test_a_scenario_has_two_forms_everywhere(head: str, tmp_path: Path, capsys: Captured) -> None:
    file = tmp_path / "mine.toml"
    file.write_text(f"{head}situation = 'double'\nepisode_steps = 7\n")
    worlds = ["--scenario", str(file)]
    assert main(["info", *worlds]) == 0
    assert "episode_steps = 7" in capsys.readouterr().out
    few = ["--episodes", "2", "--score-episodes", "2", "--long-episodes", "2"]
    assert main(["evaluate", "greedy", *worlds, *few]) == 0
    assert "situation double" in capsys.readouterr().out
    page = str(tmp_path / "a.html")
    assert main(["replay", "greedy", *worlds, "--episodes", "1", "-o", page]) == 0
    bad = tmp_path / "bad.toml"
    bad.write_text(f"{head}situation = 'doubel'\n")
    assert main(["play", "greedy", "--scenario", str(bad)]) == 1  # it reads both, too
    assert "scenario.situation = 'doubel'" in capsys.readouterr().err


@pytest.mark.parametrize("name", COMMANDS)
def test_short_help_fits_a_screen_and_names_what_exists(name: str, capsys: Captured) -> None:
    text = printed(capsys, name, "--help")
    assert text == printed(capsys, name, "-h")
    lines = text.splitlines()
    assert lines[0].startswith(f"usage: innerattn {name} ")
    assert len(lines) <= 24
    assert max(map(len, lines)) <= 80
    assert lines[-1].startswith(f"`innerattn {name} --help-all` shows every option")
    command = command_type([]) if name == "train" else COMMANDS[name]
    offered = set(re.findall(r"(?<![\w.-])--[a-z][\w.-]*", text)) - {"--help-all"}
    assert offered <= set(option_names(command))
    assert len(offered) >= min(6, len(option_names(command)) - len(("debug", "help-all")))
    everything = printed(capsys, name, "--help-all")
    assert all(option in everything for option in offered)
    assert len(everything.splitlines()) > len(lines)


def test_the_bare_command_shows_the_help(capsys: Captured) -> None:
    text = printed(capsys)
    assert text == printed(capsys, "--help")
    assert all(name in text for name in COMMANDS)


def test_options_are_spelt_with_dashes(capsys: Captured) -> None:
    text = printed(capsys, "train", "--help-all")
    assert not re.findall(r"--[\w.-]*_[\w.-]*", text)
    assert not [name for name in option_names(command_type([])) if "_" in name]


def test_underscores_are_taken_too() -> None:
    for words in (
        ["--train.warm-start", "greedy"],
        ["--train.warm_start", "greedy"],
        ["--warm_start=greedy"],
    ):
        assert command_type(words).defaults.train.warm_start == "greedy"


def test_option_names() -> None:
    assert option_names(Info) == ["--debug", "--help-all", "--scenario", "--instance", "--schema"]
    names = option_names(command_type([]))
    wanted = {"--seed", "--train.seed", "--scenario", "--scenario.observe-faults", "--td.gamma"}
    assert wanted | {"--scenario.no-observe-faults", "--quiet"} <= set(names)
    assert "--scenario.robots" not in names


@pytest.mark.parametrize("shell", SHELLS)
def test_completion_is_a_valid_script(shell: str, tmp_path: Path, capsys: Captured) -> None:
    text = printed(capsys, "--completion", shell)
    for word in ("robustness", "--preset", "td-uniform", "--train.warm-start"):
        assert word.removeprefix("--") in text, word
    if shutil.which(shell) is None:
        assert shell != "bash"
        return  # nothing here could read it
    (tmp_path / "script").write_text(text)
    subprocess.run([shell, "-n", str(tmp_path / "script")], check=True)


def test_completion_offers_commands_in_bash(tmp_path: Path, capsys: Captured) -> None:
    (tmp_path / "script").write_text(printed(capsys, "--completion", "bash"))
    ask = "COMP_WORDS=(innerattn rob); COMP_CWORD=1; _tyro_innerattn; echo ${COMPREPLY[@]}"
    done = subprocess.run(
        ["bash", "-c", f"source {tmp_path / 'script'}; {ask}"], capture_output=True, text=True
    )
    assert done.stdout.split() == ["robustness"], done.stderr


def test_quiet_leaves_the_result(tiny: list[str], tmp_path: Path, capsys: Captured) -> None:
    run = tmp_path / "run"
    assert main(["train", "--run-dir", str(run), *tiny, "--quiet"]) == 0
    out, err = capsys.readouterr()
    assert re.fullmatch(rf"{run}: .+ rescues per episode of 25 steps, score .+\n", out)
    assert err == ""
    assert main(["evaluate", str(run), "-q"]) == 0
    out, err = capsys.readouterr()
    assert re.fullmatch(rf"{run}: .+ rescues per episode of 25 steps, score .+\n", out)
    assert err == ""
    short = [*tiny, "--train.env-steps", "40", "-q"]
    assert main(["train", "--run-dir", str(tmp_path / "short"), *short]) == 0
    out, err = capsys.readouterr()
    assert out.count("\n") == 1
    assert "warning" in err  # which is never left out


def test_info_prints_schemas(capsys: Captured) -> None:
    assert main(["info", "--schema", "scenario"]) == 0
    assert '"situation"' in capsys.readouterr().out
