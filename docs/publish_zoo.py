"""Puts trained runs into the zoo that comes with the package, and lists it in `docs/zoo.md`.

`python docs/publish_zoo.py NAME=RUN ... --budget fast` takes the run that `innerattn train
--preset NAME --budget fast` makes, finished and measured. Without arguments it lists the zoo anew.
"""

from __future__ import annotations

import argparse
import json
import shutil
import sys
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from innerattn.config import load_run_config
from innerattn.config.files import write_whole
from innerattn.config.load import ANY
from innerattn.errors import InnerattnError, RunError
from innerattn.experiments.plan import Case
from innerattn.experiments.run import read_run
from innerattn.records.run_files import RunFiles, seal
from innerattn.records.run_folder import config_of, weights_name
from innerattn.report.marks import fill
from innerattn.train.policy import moments_in
from innerattn.train.weights import MOST_BYTES as MAX_WEIGHTS
from innerattn.train.weights import weights_in, write_weights
from innerattn.zoo import CARD, FOLDER, PREFIX, read_card, zoo_names

PAGE = Path(__file__).parent / "zoo.md"
MOST_BYTES = 6_000_000
"""Of the whole zoo."""


def main() -> None:
    """Pack the runs that are named on the command line, then fill the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("runs", nargs="*", metavar="NAME=RUN")
    parser.add_argument("--budget", default="strong", help="that the runs were trained with")
    given = parser.parse_args()
    try:
        for one in given.runs:
            name, _, run = one.partition("=")
            pack(Path(run), name, given.budget)
        fill(PAGE, "teams", table(FOLDER))
    except InnerattnError as error:
        sys.exit(str(error))
    size = sum(file.stat().st_size for file in FOLDER.rglob("*") if file.is_file())
    if size > MOST_BYTES:
        sys.exit(f"{FOLDER}: {size:,} bytes: must be at most {MOST_BYTES:,}")


def pack(run: Path, name: str, budget: str, zoo: Path = FOLDER) -> Path:
    """Put a run into the zoo, in place of one of the same name.

    The optimisers' moments, two thirds of the weights' file, are left out.

    Args:
        run: folder of a finished and measured run.
        name: of the built-in scenario that it was trained in, or "any" for a policy for any team;
            and of the team from now on.
        budget: that it was trained with.
        zoo: where teams are.

    Raises:
        RunError: the run is not finished or measured, or not what the command on its card makes.
    """
    files = RunFiles(run)
    config, info = config_of(files), files.info
    if info.state != "done" or not info.sealed or info.weights_sha256 is None:
        raise RunError(f"{run}: must be finished, measured and sealed")
    method, seed = config.train.method, config.train.seed
    warm = config.train.warm_start
    options = {
        "train.seed": seed,
        "train.threads": info.threads,
        "train.warm_start": warm,
        "evaluate.seed": config.evaluate.seed,
    }
    what = f"--preset {name}"
    if name == ANY:
        what = f"--family {ANY}" + ("" if warm == "none" else f" --warm-start {warm}")
        expected = load_run_config(method=method, budget=budget, overrides=options, family=ANY)
    else:
        expected = load_run_config(name, method, budget, overrides=options)
    if expected.digest() != config.digest():
        raise RunError(f"{run}: was trained otherwise than {what} --budget {budget} says")
    found = read_run(Case(config.scenario.situation, method, seed), run, steps=False)
    card: dict[str, Any] = {
        "schema_version": 1,
        "name": name,
        "command": f"innerattn train {what} --method {method} --budget {budget} "
        f"--seed {seed} --train.threads {info.threads}",
        "seed": seed,
        "versions": info.versions,
        "training_sha256": info.weights_sha256,
        "env_steps": info.env_steps,
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


def table(zoo: Path = FOLDER) -> str:
    """What the cards say, as a Markdown table."""
    head = (
        "| team | trained by | score, 25 steps | score, 100 steps | rescues, 25 steps |",
        "|---|---|---:|---:|---:|",
    )
    rows = []
    for name in zoo_names(zoo):
        card = read_card(name, zoo)
        short, long = card["lengths"]
        rows.append(
            f"| `{PREFIX}{name}` | `{card['command']}` | {_interval(short['score'])} | "
            f"{_interval(long['score'])} | {_interval(short['rescues_per_episode'])} |"
        )
    return "\n".join((*head, *rows))


def _length(summary: dict[str, Any]) -> dict[str, Any]:
    """What a summary says of one length of episodes."""
    episodes = summary.get("score_episodes", summary["episodes"])
    kept = ("episode_steps", "rescues_per_episode", "score")
    return {"episodes": episodes} | {name: summary[name] for name in kept}


def _interval(value: dict[str, float] | None) -> str:
    if value is None:
        return "-"
    return f"{value['mean']:.2f} ± {(value['high'] - value['low']) / 2:.2f}"


if __name__ == "__main__":
    main()
