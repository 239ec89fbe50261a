"""What is left in a study's folder where no run is finished."""

from __future__ import annotations

from pathlib import Path

import pytest

from innerattn.report.outputs import make_outputs


@pytest.mark.parametrize(
    ("target", "gone"),
    [
        ("table2", {"report.md", "table2.csv"}),
        ("all", {"report.md", "table2.csv", "fig5_evidence.pdf"}),
        ("crossed", {"crossed.md"}),
    ],
)
def test_files_of_earlier_runs_do_not_outlive_them(
    target: str, gone: set[str], tmp_path: Path
) -> None:
    names = {"report.md", "table2.csv", "fig5_evidence.pdf", "crossed.md", "table2-mine.csv"}
    for name in names:
        (tmp_path / name).touch()
    assert make_outputs(target, [], tmp_path, "short", ["mixed td-inner seed 0: failed"]) == []
    assert {path.name for path in tmp_path.iterdir()} == names - gone
    assert make_outputs(target, [], tmp_path / "none", "short", []) == []
