"""What checkpoints cost: how long training stands still for a save, and the share of its time.

`python benches/checkpoint_cost.py` trains the budgets below with twenty saves each, and prints the
results. It publishes nothing.
"""

from __future__ import annotations

import argparse
import statistics
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from page import machine, table

from innerattn.config import load_run_config
from innerattn.train import train
from innerattn.train.recorded import RecordedStages

SAVES = 20
RUNS = (
    ("td-inner", "quick", 250_000),  # its replay of 200,000 transitions, 289 MB, is full then
    ("ppo-inner", "quick", None),
    ("ppo-inner", "fast", None),
)
"""Method, budget and env-steps; none: those of the budget."""


@dataclass
class Stalls:
    """How long training stood still [s].

    Attributes:
        saves: for each checkpoint.
        rows: for files of rows between checkpoints, whenever one was full.
    """

    saves: list[float] = field(default_factory=list)
    rows: list[float] = field(default_factory=list)


@contextmanager
def timed(name: str, into: list[float]) -> Iterator[None]:
    """Let a method of `RecordedStages` write down its seconds inside the block."""
    original: Callable[..., Any] = getattr(RecordedStages, name)

    def method(self: RecordedStages) -> Any:
        start = time.perf_counter()
        try:
            return original(self)
        finally:
            into.append(time.perf_counter() - start)

    setattr(RecordedStages, name, method)
    try:
        yield
    finally:
        setattr(RecordedStages, name, original)


def measure(method: str, budget: str, env_steps: int | None) -> tuple[Stalls, float]:
    """Stalls and seconds of one training."""
    total = env_steps or load_run_config("mixed", method, budget).train.env_steps
    overrides = {
        "train.env_steps": total,
        "train.checkpoint_every_env_steps": max(1, total // SAVES),
        "train.checkpoint_every_minutes": 0.0,
    }
    config, found = load_run_config("mixed", method, budget, overrides=overrides), Stalls()
    with (
        tempfile.TemporaryDirectory(dir=Path.cwd(), prefix="checkpoint-cost-") as folder,
        timed("_save", found.saves),
        timed("_write_whole_row_files", found.rows),
    ):
        start = time.perf_counter()
        train(config, Path(folder) / "run")
        return found, time.perf_counter() - start


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--env-steps", type=int, default=None, help="of each run; none: the budget")
    options = parser.parse_args(arguments)
    head = [
        "run",
        "saves",
        "median, ms",
        "longest, ms",
        "rows, longest, ms",
        "share",
        "each minute",
    ]
    rows = []
    for method, budget, env_steps in RUNS:
        found, seconds = measure(method, budget, options.env_steps or env_steps)
        median, between = statistics.median(found.saves), sum(found.rows)
        rows.append(
            [
                f"{method} {budget}",
                f"{len(found.saves)}",
                f"{1e3 * median:.1f}",
                f"{1e3 * max(found.saves):.1f}",
                f"{1e3 * max(found.rows):.1f}",
                f"{(sum(found.saves) + between) / seconds:.2%}",
                f"{median / 60.0 + between / seconds:.2%}",
            ]
        )
    print(f"{machine('torch')}.\n\n{table(head, rows)}")
    print(
        "\nshare: of the time of this training; each minute: with one save a minute, the default."
    )


if __name__ == "__main__":
    main()
