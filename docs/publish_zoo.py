"""Puts trained runs into the zoo that comes with the package, and lists it in `docs/zoo.md`.

`python docs/publish_zoo.py NAME=RUN ... --budget fast` takes the run that `innerattn train
--preset NAME --budget fast` makes, finished and measured; or `--scenario
examples/scenarios/NAME.toml`, where no preset has the name. Further options of that command are
given as `--options="--warm-start planner"`. Without arguments it lists the zoo anew.
"""

from __future__ import annotations

import argparse
import json
import shlex
import shutil
import sys
from contextlib import chdir
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from innerattn.cli.train import command_type
from innerattn.cli.usage import parse
from innerattn.config import SCENARIOS, RunConfig
from innerattn.config.files import write_whole
from innerattn.config.load import ANY
from innerattn.errors import InnerattnError, RunError
from innerattn.experiments.plan import Case
from innerattn.experiments.run import read_run
from innerattn.policies import best_script
from innerattn.records.run_files import RunFiles, seal
from innerattn.records.run_folder import config_of, weights_name
from innerattn.report.marks import fill
from innerattn.studies.results import SEEN, score_as_seen
from innerattn.train.policy import moments_in
from innerattn.train.weights import MOST_BYTES as MAX_WEIGHTS
from innerattn.train.weights import weights_in, write_weights
from innerattn.train.workers.choose import with_number_of_workers
from innerattn.zoo import CARD, FOLDER, PREFIX, read_card, zoo_names

PAGE = Path(__file__).parent / "zoo.md"
ROOT = Path(__file__).parents[1]
WORKED = "examples/scenarios"
"""Where the scenarios are that are no presets, from `ROOT`."""
MOST_BYTES = 14_000_000
"""Of the whole zoo."""


def main() -> None:
    """Pack the runs that are named on the command line, then fill the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("runs", nargs="*", metavar="NAME=RUN")
    parser.add_argument("--budget", default="strong", help="that the runs were trained with")
    parser.add_argument(
        "--options", default="", help='other options of the runs, as in --options="--device cpu"'
    )
    given = parser.parse_args()
    try:
        for one in given.runs:
            name, _, run = one.partition("=")
            pack(Path(run), name, given.budget, options=given.options)
        fill(PAGE, "teams", table(FOLDER))
        fill(PAGE, "commands", commands(FOLDER))
    except InnerattnError as error:
        sys.exit(str(error))
    size = sum(file.stat().st_size for file in FOLDER.rglob("*") if file.is_file())
    if size > MOST_BYTES:
        sys.exit(f"{FOLDER}: {size:,} bytes: must be at most {MOST_BYTES:,}")


def pack(run: Path, name: str, budget: str, zoo: Path = FOLDER, options: str = "") -> Path:
    """Put a run into the zoo, in place of one of the same name.

    The optimisers' moments, two thirds of the weights' file, are left out.

    Args:
        run: folder of a finished and measured run.
        name: of the scenario that it was trained in, a preset or a file in `WORKED`, or "any" for a
            policy for any team; and of the team from now on.
        budget: that it was trained with.
        zoo: where teams are.
        options: other options of `innerattn train` that it was trained with, as in a shell.

    Raises:
        RunError: the run is not finished or measured, or not what the command on its card makes.
        SystemExit: ``options`` are no options of the command.
    """
    files = RunFiles(run)
    config, info = config_of(files), files.info
    if info.state != "done" or not info.sealed or info.weights_sha256 is None:
        raise RunError(f"{run}: must be finished, measured and sealed")
    method, seed = config.train.method, config.train.seed
    given = f"{_worlds(name)} --method {method} --budget {budget} {options}".strip()
    command = f"innerattn train {given} --seed {seed} --train.threads {info.threads}"
    expected = config_of_command(command)
    if expected.digest() != config.digest():
        differing = ", ".join(_differing(expected, config))
        raise RunError(f"{run}: was trained otherwise than {given} says: {differing}")
    found = read_run(Case(config.scenario.situation, method, seed), run, steps=False)
    card: dict[str, Any] = {
        "schema_version": 1,
        "name": name,
        "command": command,
        "seed": seed,
        "versions": info.versions,
        "training_sha256": info.weights_sha256,
        "env_steps": info.env_steps,
        "script": best_script(found.summary["scripted"]),
        "lengths": [_length(one) for one in (found.summary, found.summary["long"])],
        "worlds_seed": config.evaluate.seed,
    }
    weights = weights_name(files)
    with TemporaryDirectory(dir=zoo, prefix=".") as work:
        made = Path(work) / name
        (made / weights).parent.mkdir(parents=True)
        for file in ("config.toml", "checkpoints/latest"):
            shutil.copyfile(run / file, made / file)
        tensors = weights_in(files.read(weights, MAX_WEIGHTS), run / weights, info.weights_sha256)
        kept = {key: tensor for key, tensor in tensors.items() if key not in moments_in(tensors)}
        card["weights_sha256"] = write_weights(made / weights, kept)
        write_whole(made / CARD, f"{json.dumps(card, indent=1)}\n".encode())
        seal(made, replace(info, sealed=False, weights_sha256=card["weights_sha256"]))
        shutil.rmtree(zoo / name, ignore_errors=True)
        made.rename(zoo / name)
    return zoo / name


def config_of_command(command: str) -> RunConfig:
    """The configuration of the run that a command makes in `ROOT`.

    Raises:
        ConfigError: it makes none.
        SystemExit: it is no command, see `innerattn.cli.usage.parse`.
    """
    _, _, *words = shlex.split(command)
    with chdir(ROOT):
        config: RunConfig = parse(command_type(words), words, "innerattn train").single_run()
    return with_number_of_workers(config)


def table(zoo: Path = FOLDER) -> str:
    """What the cards say of scores, as a Markdown table."""
    rows = [
        "| team | script | steps | rescues | score | as seen | long: steps | long: score |",
        "|---|---|---:|---:|---:|---:|---:|---:|",
    ]
    for name in zoo_names(zoo):
        card = read_card(name, zoo)
        short, long = card["lengths"]
        seen = short.get("score_as_seen")
        cells = [
            f"`{PREFIX}{name}`",
            f"`{card['script']}`",
            str(short["episode_steps"]),
            _interval(short["rescues_per_episode"]),
            _interval(short["score"]),
            "" if seen is None else f"{seen:.2f}",
            str(long["episode_steps"]),
            _interval(long["score"]),
        ]
        rows.append(f"| {' | '.join(cells)} |")
    return "\n".join(rows)


def commands(zoo: Path = FOLDER) -> str:
    """What the cards say of how teams were made, as a Markdown table."""
    rows = ["| team | trained by |", "|---|---|"]
    for name in zoo_names(zoo):
        rows.append(f"| `{PREFIX}{name}` | `{read_card(name, zoo)['command']}` |")
    return "\n".join(rows)


def _worlds(name: str) -> str:
    """The option of `innerattn train` that says in which worlds a team was trained."""
    if name == ANY:
        return f"--family {ANY}"
    if name in SCENARIOS:
        return f"--preset {name}"
    file = f"{WORKED}/{name}.toml"
    if not (ROOT / file).is_file():
        raise RunError(f"{name}: must be {ANY}, a preset or the name of a file in {WORKED}")
    return f"--scenario {file}"


def _differing(one: RunConfig, other: RunConfig) -> list[str]:
    """The keys, with their sections, of which two configurations have other values."""
    values, others = one.digest_values(), other.digest_values()
    return [
        f"{section}.{key}"
        for section in sorted(values.keys() | others.keys())
        for mine, theirs in [(values.get(section, {}), others.get(section, {}))]
        for key in sorted(mine.keys() | theirs.keys())
        if mine.get(key) != theirs.get(key)
    ]


def _length(summary: dict[str, Any]) -> dict[str, Any]:
    """What a summary says of one length of episodes."""
    episodes = summary.get("score_episodes", summary["episodes"])
    kept = ("episode_steps", "rescues_per_episode", "score")
    seen = {"score_as_seen": score_as_seen(summary)} if SEEN in summary["scripted"] else {}
    return {"episodes": episodes} | {name: summary[name] for name in kept} | seen


def _interval(value: dict[str, float] | None) -> str:
    if value is None:
        return "-"
    return f"{value['mean']:.2f} ± {(value['high'] - value['low']) / 2:.2f}"


if __name__ == "__main__":
    main()
