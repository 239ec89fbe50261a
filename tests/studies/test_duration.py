"""Time left, from the times of files."""

import os
from pathlib import Path

import pytest

from innerattn.studies.duration import Duration, duration_of, in_words
from innerattn.studies.ledger import State


def finished(folder: Path, key: str, took: float) -> None:
    claim, summary = folder / "claims" / f"{key}.1", folder / "runs" / key / "evaluation"
    summary.mkdir(parents=True)
    claim.parent.mkdir(exist_ok=True)
    claim.write_text("")
    (summary / "summary.json").write_text("{}")
    os.utime(claim, (1_000.0, 1_000.0))
    os.utime(summary / "summary.json", (1_000.0 + took, 1_000.0 + took))


def test_it_is_the_median_of_finished_runs(tmp_path: Path) -> None:
    for key, took in (("a", 60.0), ("b", 100.0), ("c", 9_000.0)):
        finished(tmp_path, key, took)
    states: dict[str, State] = {"a": "done", "b": "done", "c": "done", "d": "failed"}
    assert duration_of(tmp_path, states, 0) == Duration(100.0, 0.0, 0)
    states |= {f"w{n}": "planned" for n in range(5)}
    assert duration_of(tmp_path, states, 5) == Duration(100.0, 500.0, 0)
    states |= {"x": "claimed", "y": "claimed"}
    assert duration_of(tmp_path, states, 7) == Duration(100.0, 300.0, 2)


def test_before_the_first_one_nothing_is_known(tmp_path: Path) -> None:
    assert duration_of(tmp_path, {"a": "planned", "b": "claimed"}, 2) is None
    assert duration_of(tmp_path, {"gone": "done"}, 0) is None


@pytest.mark.parametrize(
    ("seconds", "words"),
    [(0.4, "0 s"), (80.0, "80 s"), (90.0, "2 min"), (5_400.0, "1.5 h"), (2e5, "2.3 days")],
)
def test_times_in_words(seconds: float, words: str) -> None:
    assert in_words(seconds) == words
