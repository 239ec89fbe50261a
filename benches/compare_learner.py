"""An update of the off-policy learner beside MAAC's public code, and what the machine allows.

`python benches/compare_learner.py --maac PATH` writes its tables into `docs/performance.md`. PATH
is a checkout of the public code, which nothing here downloads. The stand-in is the tests' plain
reference, a loop over robots and heads that we wrote to check results. It is not the public code;
without `--maac` it is all that our updates are compared with.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

from maac_checkout import COMMIT, GET_IT, describe_checkout
from page import machine, publish, table

CASES = [(batch, threads) for batch in (256, 1024) for threads in (1, 2)]
ROUNDS = 3
PROTOCOL_UPDATES = 25_000
MEASURED_UPDATES = 400
PEERS = ("public code", "public code, oneDNN", "stand-in")
OURS = ("eager", "compiled")
BESIDE = ("draw, public code", "draw, ours", "act")
NOT_GIVEN = "MAAC's public code was not given (`--maac`): our updates are beside the stand-in only."

Case = tuple[int, int]
"""Batch size and threads."""
Round = dict[str, float]
"""Milliseconds by name, of one process."""


def options(words: Sequence[str] | None = None) -> argparse.Namespace:
    """The command line: `maac` (a path or None) and `state`, which says what commit is there."""
    parser = argparse.ArgumentParser(
        formatter_class=argparse.RawDescriptionHelpFormatter,
        description="Times one update by MAAC's public code and by ours, and fills "
        "docs/performance.md.",
        epilog=f"The public code, at the commit that the comparison is made for:\n\n{GET_IT}",
    )
    parser.add_argument(
        "--maac", type=Path, metavar="PATH", help=f"checkout of the public code at {COMMIT}"
    )
    parser.add_argument(
        "--any-maac-commit",
        action="store_true",
        help="accept a checkout at another commit, or with changed files",
    )
    given = parser.parse_args(words)
    if given.any_maac_commit and not given.maac:
        parser.error("--any-maac-commit needs --maac PATH")
    given.state = NOT_GIVEN
    if given.maac:
        given.maac = given.maac.expanduser().resolve()
        try:
            commit = describe_checkout(given.maac, given.any_maac_commit)
        except ValueError as error:
            parser.error(str(error))
        given.state = f"MAAC's public code: {commit}."
    return given


def one_round(case: Case, checkout: Path | None) -> Round:
    """Updates of one batch size, in turn, in a process of their own that has so many threads.

    Raises:
        SystemExit: The process failed; its messages are shown.
    """
    batch, threads = case
    command = [sys.executable, str(Path(__file__).with_name("learner_update.py"))]
    command += [str(batch), str(threads), *([str(checkout)] if checkout else [])]
    counts = {"OMP_NUM_THREADS": str(threads), "MKL_NUM_THREADS": str(threads)}
    done = subprocess.run(command, capture_output=True, text=True, env=os.environ | counts)
    if done.returncode:
        sys.exit(f"batch {batch}, {threads} threads: the measurement failed\n{done.stderr}")
    found: Round = json.loads(done.stdout.splitlines()[-1])
    return found


def update_tables(rounds: dict[Case, list[Round]]) -> str:
    """Tables of times, of ratios, and of what stands beside an update.

    Args:
        rounds: Of each case its rounds; all have the same names.
    """
    names = next(iter(rounds.values()))[0]
    peers = [name for name in PEERS if name in names]

    def ms(case: Case, name: str, digits: int) -> str:
        return f"{statistics.median(found[name] for found in rounds[case]):.{digits}f}"

    def ratio(case: Case, peer: str, own: str) -> str:
        each = [found[peer] / found[own] for found in rounds[case]]
        return f"{statistics.median(each):.2f} ({min(each):.2f} to {max(each):.2f})"

    def by_case(head: Sequence[str], cells: Callable[[Case], Sequence[str]]) -> str:
        rows = [[str(batch), str(threads), *cells((batch, threads))] for batch, threads in rounds]
        return table(["batch", "threads", *head], rows)

    updates = [*peers, *OURS, "products"]
    beside = [name for name in BESIDE if name in names]
    pairs = [(peer, own) for peer in peers for own in OURS]
    return "\n\n".join(
        [
            by_case([f"{x}, ms" for x in updates], lambda case: [ms(case, x, 1) for x in updates]),
            f"Times as fast, median (lowest to highest) of {ROUNDS} rounds:",
            by_case(
                [f"{own} vs {peer}" for peer, own in pairs],
                lambda case: [ratio(case, peer, own) for peer, own in pairs],
            ),
            by_case([f"{x}, ms" for x in beside], lambda case: [ms(case, x, 2) for x in beside]),
        ]
    )


def pace_and_start_s(compiled: str, threads: int) -> tuple[float, float]:
    """Seconds an update with its steps, and seconds before the first, of the paper's protocol."""
    with tempfile.TemporaryDirectory() as folder:
        run = Path(folder) / "run"
        command = [sys.executable, "-m", "innerattn", "train", "--budget", "paper", "--seed", "0"]
        command += ["--train.env-steps", str(25 * MEASURED_UPDATES), "--compile", compiled]
        command += ["--train.threads", str(threads), "--train.log-every-env-steps", "2500"]
        command += ["--evaluate.score-episodes", "2", "--evaluate.long-episodes", "2"]
        subprocess.run([*command, "--run-dir", str(run)], check=True, capture_output=True)
        lines = [json.loads(line) for line in (run / "metrics.jsonl").read_text().splitlines()]
    first, last = lines[0], lines[-1]
    pace = (last["seconds"] - first["seconds"]) / (last["updates"] - first["updates"])
    return pace, last["seconds"] - pace * last["updates"]


def protocol_table() -> str:
    """25,000 episodes and updates, eager and compiled, from the pace of runs in turn."""
    cases = ("off", "on")
    found: dict[str, list[tuple[float, float]]] = {case: [] for case in cases}
    for _ in range(ROUNDS):
        for case in cases:
            found[case].append(pace_and_start_s(case, threads=2))
    rows = []
    for case in cases:
        pace, start = (statistics.median(values) for values in zip(*found[case], strict=True))
        minutes = (start + pace * PROTOCOL_UPDATES) / 60.0
        rows.append([case, f"{1e3 * pace:.1f}", f"{max(start, 0.0):.0f}", f"{minutes:.1f}"])
    head = ["--compile", "update and its steps, ms", "start, s", "25,000 updates, min"]
    return table(head, rows)


def main() -> None:
    """Measure and publish the tables."""
    given = options()
    print(given.state, flush=True)
    rounds: dict[Case, list[Round]] = {case: [] for case in CASES}
    for _ in range(ROUNDS):
        for case in CASES:
            rounds[case].append(one_round(case, given.maac))
    parts = [f"{machine('numpy', 'torch')}. {given.state}", update_tables(rounds), protocol_table()]
    publish("compare_learner", "\n\n".join(parts))


if __name__ == "__main__":
    main()
