"""Runs the programs in `examples/libraries`, each in its own environment, and checks the scores.

An environment sees the packages of the Python that runs this file, innerattn among them. pip adds
what is missing or has another version than the example asks for. So nothing is compiled again, and
environments share one PyTorch. They lie in `examples/libraries/.venvs` and are used again.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import sysconfig
import time
from pathlib import Path
from typing import Any, NamedTuple

LIBRARIES = Path(__file__).parent / "libraries"
VENVS = LIBRARIES / ".venvs"
LEAST_SCORE = 0.05
"""What a team must reach to have learnt something; 0 is random play."""


class Example(NamedTuple):
    """A program and how it is run."""

    program: str
    """The file in `examples/libraries`, whose requirements have the same name."""
    env_steps: int
    """Enough of them for a score that is surely above random."""
    arguments: tuple[str, ...] = ()


EXAMPLES = {
    "ppo-inner": Example("innerattn_methods", 25_000, ("--method", "ppo-inner")),
    "mappo": Example("innerattn_methods", 25_000, ("--method", "mappo")),
    "td-inner": Example("innerattn_methods", 25_000, ("--method", "td-inner")),
    "single-file-mappo": Example("single_file_mappo", 100_000),
    "sb3-gymnasium": Example("sb3_ppo", 50_000, ("--view", "gymnasium")),
    "sb3-pettingzoo": Example("sb3_ppo", 25_000, ("--view", "pettingzoo")),
    "torchrl-mappo": Example("torchrl_mappo", 50_000),
    "optuna": Example("optuna_search", 120_000, ("--trials", "2")),
    "benchmarl-mappo": Example("benchmarl_teams", 50_000, ("--algorithm", "mappo")),
    "benchmarl-masac": Example("benchmarl_teams", 24_000, ("--algorithm", "masac")),
    "rllib-ppo": Example("rllib_ppo", 48_000),
    "xuance-mappo": Example("xuance_mappo", 50_000),
}


def environment(program: str) -> Path:
    """The Python of a program's environment, which is made if it is missing or out of date."""
    folder = VENVS / program
    python = folder / "bin" / "python"
    wanted = (LIBRARIES / "requirements" / f"{program}.txt").read_text("utf-8")
    stamp = folder / "installed.txt"
    if stamp.is_file() and stamp.read_text("utf-8") == wanted:
        return python
    _run(sys.executable, "-m", "venv", "--clear", str(folder))
    own = sysconfig.get_path("purelib", vars={"base": str(folder), "platbase": str(folder)})
    borrowed = sysconfig.get_path("purelib")
    # What is found first wins: the environment's own packages, then those of this Python.
    # `addsitedir` also reads the files there that lead to packages elsewhere, such as a checkout's.
    line = f"import site; site.addsitedir({borrowed!r})\n"
    (Path(own) / "zz_borrowed.pth").write_text(line, "utf-8")
    _run(str(python), "-m", "pip", "install", "--quiet", "-r", f"requirements/{program}.txt")
    stamp.write_text(wanted, "utf-8")
    return python


def run(name: str, env_steps: int | None = None, *more: str) -> dict[str, Any]:
    """Train one example and return what it printed last.

    Args:
        name: one of `EXAMPLES`.
        env_steps: how long it trains; none: its own number.
        more: further arguments of the program.

    Raises:
        subprocess.CalledProcessError: it failed, or its environment could not be made.
    """
    example = EXAMPLES[name]
    python = environment(example.program)
    steps = example.env_steps if env_steps is None else env_steps
    command = [f"{example.program}.py", *example.arguments, "--env-steps", str(steps), *more]
    printed = _run(str(python), *command).strip().splitlines()
    result: dict[str, Any] = json.loads(printed[-1])
    return result


def _run(*command: str) -> str:
    """Run a command in `examples/libraries`; its errors go through, its output comes back.

    The networks are so small that a second thread of PyTorch costs more than it saves; where other
    programs use the machine, too, it costs many times as much.
    """
    kept = {key: value for key, value in os.environ.items() if key != "PIP_CONSTRAINT"}
    kept = {"OMP_NUM_THREADS": "1"} | kept
    done = subprocess.run(
        command, cwd=LIBRARIES, env=kept, check=True, stdout=subprocess.PIPE, text=True
    )
    return done.stdout


def main() -> None:
    """Run examples and say which failed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"of {', '.join(EXAMPLES)}")
    parser.add_argument("--env-steps", type=int, help="for each, in place of its own number")
    given = parser.parse_args()
    if unknown := sorted(set(given.names) - set(EXAMPLES)):
        parser.error(f"no example {', '.join(unknown)}: known are {', '.join(EXAMPLES)}")
    failed = []
    for name in given.names or EXAMPLES:
        began = time.perf_counter()
        try:
            result = run(name, given.env_steps)
        except subprocess.CalledProcessError as error:
            print(f"{name}: {error}", flush=True)
            failed.append(name)
            continue
        enough = result["score"] >= LEAST_SCORE
        state = "ok" if enough else f"score below {LEAST_SCORE}"
        seconds = time.perf_counter() - began
        print(f"{name}: {state}, {seconds:.0f} s in all: {json.dumps(result)}", flush=True)
        failed += [] if enough else [name]
    if failed:
        sys.exit(f"failed: {', '.join(failed)}")


if __name__ == "__main__":
    main()
