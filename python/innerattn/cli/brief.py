"""The help that fits one screen: the options that most people need, and examples.

`--help-all` shows all options, written by the library that parses them.
"""

from __future__ import annotations

import dataclasses
import textwrap
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

_COLUMNS = 80
_MEANING = 23
"""Column at which meanings begin."""


class Brief(NamedTuple):
    """What the short help of a command shows.

    Attributes:
        usage: what stands after the command's name.
        rows: options or arguments as they are written, and what they mean; a name in braces in a
            meaning stands for the default of that field.
        examples: words after the command's name.
    """

    usage: str
    rows: Sequence[tuple[str, str]]
    examples: Sequence[str]


_QUIET = ("-q, --quiet", "print warnings, errors and one line with the result only")
_JSON = ("--json FILE", "write the results to FILE too; - for standard output")

BRIEF: Mapping[str, Brief] = {
    "demo": Brief(
        "[OPTIONS]",
        (
            ("-o, --output FILE", "page to write: .html ({output})"),
            ("--no-open", "do not open the page in a browser"),
            ("--episodes N", "episodes that rescues are averaged over ({episodes:,})"),
            ("--seed N", "seed of the worlds ({seed})"),
            _QUIET,
        ),
        ("", "--no-open -o team.html"),
    ),
    "train": Brief(
        "[OPTIONS]",
        (
            ("--preset NAME", "built-in scenario ({preset}); innerattn info lists all"),
            ("--scenario FILE", "TOML file with a scenario of your own, instead"),
            ("--method NAME", "td-inner, td-uniform, ppo-inner, ppo-uniform, mappo ({method})"),
            ("--budget NAME", "fast, quick, short, strong or paper ({budget})"),
            (
                "--warm-start NAME",
                "script to imitate: hungarian, planner or greedy ({warm_start})",
            ),
            ("--seed N", "seed of everything random ({seed})"),
            ("--seeds LIST", "one run for each seed: 0..4, or 0,3,7"),
            ("--family any|FILE", "one policy for many teams: built-in or ranges"),
            ("--train.env-steps N", "length of learning, summed over worlds ({train.env_steps:,})"),
            ("--config FILE", "TOML file with configuration keys (docs/reference)"),
            ("--run-dir FOLDER", "folder to make for the run (under runs)"),
            ("--resume RUN", "go on with a run that was stopped"),
            _QUIET,
        ),
        (
            "--method ppo-inner --budget fast",
            "--scenario flood.toml --seeds 0..4 --td.learning-rate 0.001",
            "--resume latest",
        ),
    ),
    "evaluate": Brief(
        "[OPTIONS] RUN|POLICY",
        (
            (
                "RUN|POLICY",
                "a run (folder, latest, zoo:NAME, or how its name begins), or a "
                "script: random, greedy, greedy-seen, hungarian, planner, oracle",
            ),
            ("--scenario FILE", "TOML file with the scenario to measure in"),
            ("--situation NAME", "single, double, mixed, poisson or listed"),
            ("--score-episodes N", "episodes that rescues are averaged over (1000)"),
            ("--episodes N", "episodes that cooperation is counted in (80)"),
            ("--episode-steps N", "length of an episode (that of the run)"),
            ("--seed N", "seed of the worlds (12345), or of the planner (0)"),
            ("--instances FILE", "measure in worlds (standard) or on points (ral)"),
            ("--engine NAME", "let bodies do what is planned: rapier, discs or none"),
            ("--time-limit-ms N", "how long planner searches for an instance (1000)"),
            _JSON,
            _QUIET,
        ),
        ("latest", "planner --instances standard", "runs/mine --json - > mine.json"),
    ),
    "study": Brief(
        "[OPTIONS] run|work|status|report|retry|slurm STUDY",
        (
            ("run", "begin or continue a study, with a worker for each core"),
            ("work", "be one worker, here or on another machine"),
            ("status", "what is done, the time left and the scores so far"),
            ("report", "write the report and the scores for other tools again"),
            ("retry", "let runs that were given up be tried again"),
            ("slurm", "print a script for sbatch whose jobs are workers"),
            ("STUDY", "the study's file (.toml), or its folder"),
            ("--out FOLDER", "folder of the study (studies/NAME)"),
            ("--pool FOLDER", "folder of runs that studies share"),
            ("--workers N", "workers, or jobs of slurm"),
            ("--ray ADDRESS", "run workers on a Ray cluster; local: of this machine"),
            ("--until TIME", "when a worker saves its run and ends: 90s, 55m, 2h"),
            ("--publish DIR", "fill the pages that the file names (report)"),
            _QUIET,
        ),
        ("run sharing.toml", "status studies/sharing", "work studies/sharing --until 55m"),
    ),
    "report": Brief(
        "[OPTIONS] RUN ...",
        (
            ("RUN", "finished runs: folders, latest, or how a name begins"),
            ("-o, --output FILE", "page to write: .html ({output})"),
            ("--robustness FILE", "results of innerattn robustness as JSON, to show too"),
        ),
        ("latest", "runs/a-s0 runs/a-s1 runs/a-s2 -o a.html"),
    ),
    "watch": Brief(
        "[OPTIONS] RUN ...",
        (
            (
                "RUN",
                "runs in training: folders, latest, how a name begins, or a folder that holds runs",
            ),
            ("--port N", "port of 127.0.0.1; 0: any that is free ({port})"),
            ("--episodes N", "episodes to play for each checkpoint ({episodes})"),
        ),
        ("latest", "runs", "runs/a-s0 runs/a-s1"),
    ),
    "play": Brief(
        "[OPTIONS] RUN|POLICY [RUN|POLICY]",
        (
            (
                "RUN|POLICY",
                "a run (also zoo:NAME), or a script: random, greedy, greedy-seen, hungarian, "
                "planner, oracle; two stand side by side",
            ),
            ("--scenario FILE", "TOML file with the scenario to play in (that of the run)"),
            ("--seed N", "seed of the world"),
            ("--spare N", "robots of each kind to add; not beside a team (2)"),
            ("--port N", "port of 127.0.0.1; 0: any that is free ({port})"),
        ),
        ("zoo:mixed", "zoo:mixed greedy", "latest --scenario flood.toml"),
    ),
    "page": Brief(
        "[OPTIONS] RUN|POLICY [RUN|POLICY]",
        (
            (
                "RUN|POLICY",
                "a run (also zoo:NAME), or random, greedy, hungarian; two stand side by side",
            ),
            ("-o, --output FILE", "page to write: .html ({output})"),
            ("--preset NAME", "built-in scenario to play in (that of the run, or mixed)"),
            ("--scenario FILE", "TOML file with the scenario to play in, instead"),
            ("--seed N", "seed of the world"),
            ("--spare N", "robots of each kind to add; not beside a team (2)"),
        ),
        ("zoo:mixed", "zoo:mixed greedy -o two.html", "zoo:any --scenario my_team.toml"),
    ),
    "export": Brief(
        "[OPTIONS] RUN",
        (
            ("RUN", "a run with weights: folder, latest, zoo:NAME, or how a name begins"),
            ("-o, --output FOLDER", "folder to make (export in the run's folder)"),
            ("--scenario FILE", "the team that a policy for any team serves (that of the run)"),
        ),
        ("latest", "zoo:mixed -o team", "zoo:any --scenario my_team.toml -o team"),
    ),
    "seal": Brief(
        "RUN ...",
        (("RUN", "folders of finished runs without a manifest, or archives (.parquet)"),),
        ("runs/old",),
    ),
    "new": Brief(
        "scenario|study NAME",
        (("NAME", "the file is NAME.toml here"),),
        ("scenario flood", "study sharing"),
    ),
    "info": Brief(
        "[OPTIONS]",
        (
            ("--scenario FILE", "check a scenario, print it with all defaults, draw it"),
            ("--instance FILE:NAME", "describe an instance: ral:ral_03, standard:sums_8_3"),
            ("--schema NAME", "print the JSON Schema of a file: scenario, run or study"),
        ),
        ("", "--scenario flood.toml", "--instance ral:ral_03"),
    ),
    "replay": Brief(
        "[OPTIONS] RUN|POLICY|FILE ...",
        (
            (
                "RUN|POLICY|FILE",
                "up to four: runs (also zoo:NAME), scripts (random, greedy, greedy-seen, "
                "hungarian, planner, oracle) or episodes.parquet files",
            ),
            ("-o, --output FILE", "what to write: .html, .gif or .mp4 ({output})"),
            ("--episodes N", "play N new episodes instead of showing recorded ones"),
            ("--scenario FILE", "TOML file with the scenario to play in"),
            ("--seed N", "seed of the worlds to play in, or of the planner"),
            ("--episode N", "which episode a moving picture shows"),
            ("--robot NAME", "robot whose attention a moving picture shows"),
            ("--attention WHO", "of the critic or the actor, in a moving picture"),
            ("--moments FILE", "TOML file with moments that the page lists"),
            ("--instance FILE", "show an instance: ral:ral_03, standard:sums_8_3"),
            ("--time-limit-ms N", "how long planner searches for it (1000)"),
        ),
        (
            "latest",
            "zoo:mixed hungarian -o both.html",
            "latest --episode 3 -o third.gif",
            "--instance ral:ral_03",
        ),
    ),
    "robustness": Brief(
        "[OPTIONS] RUN ...",
        (
            ("RUN", "runs: folders, latest, or how a name begins"),
            ("--faults KINDS", "kinds of faults, separated by commas ({faults})"),
            ("--episodes N", "worlds in which each fault is tried ({episodes})"),
            ("--episode-steps N", "length of an episode (twice that of the run)"),
            ("--seed N", "seed of the worlds"),
            _JSON,
            ("--plot FILE", "draw a heat map of the first run: .pdf, .png or .svg"),
            ("--report FILE", "write a page about the runs with these results: .html"),
            _QUIET,
        ),
        ("latest", "runs/a runs/b --faults blackout --json found.json"),
    ),
    "reproduce": Brief(
        "[OPTIONS] TARGET",
        (
            ("TARGET", "what to make: {TARGETS}"),
            (
                "--budget NAME",
                "fast, quick, short, strong or paper ({budget}, which gives no result)",
            ),
            ("--seeds N", "how many seeds ({seeds})"),
            ("--methods LIST", "methods, separated by commas ({methods})"),
            ("--presets LIST", "built-in scenarios, separated by commas ({presets})"),
            ("--out FOLDER", "folder of runs and reports (studies/BUDGET)"),
            ("--device NAME", "where networks are trained: cpu, cuda, cuda:0 ({device})"),
            ("--report-only", "train nothing; report on the runs that are finished"),
            ("--page FILE", "write a page about the finished runs too: .html"),
            _QUIET,
        ),
        ("table2 --budget short", "all --report-only", "fig4 --methods td-inner,td-uniform"),
    ),
}


def print_brief(name: str, command: Any) -> bool:
    """Print the short help of a command.

    Args:
        name: of the command.
        command: dataclass of its options, with the defaults to show.

    Returns:
        Whether there is one.
    """
    if name not in BRIEF:
        return False
    brief = BRIEF[name]
    defaults = _Defaults(command)
    print(f"usage: innerattn {name} {brief.usage}\n")
    print(f"{textwrap.fill((command.__doc__ or '').split(chr(10))[0], _COLUMNS)}\n")
    for option, meaning in brief.rows:
        print(_row(option, meaning.format_map(defaults)))
    print("\nExamples:")
    for example in brief.examples:
        print(f"  innerattn {name} {example}".rstrip())
    print(f"`innerattn {name} --help-all` shows every option with its unit and default.")
    return True


def _row(option: str, meaning: str) -> str:
    lines = textwrap.wrap(meaning, _COLUMNS - _MEANING, break_on_hyphens=False)
    head = f"  {option}".ljust(_MEANING)
    return "\n".join([head + lines[0], *(" " * _MEANING + line for line in lines[1:])])


class _Defaults(dict[str, object]):
    """Defaults of a command's fields by name, when they are asked for; sections as objects."""

    def __init__(self, command: Any) -> None:
        super().__init__()
        self._fields = {field.name: field for field in dataclasses.fields(command)}

    def __missing__(self, name: str) -> object:
        if name == "TARGETS":
            from innerattn.report.targets import TARGETS

            return ", ".join(TARGETS)
        field = self._fields[name]
        if field.default is not dataclasses.MISSING:
            return field.default
        assert callable(field.default_factory)
        return field.default_factory()
