"""The registry of targets: what each needs, and what is left where no run is finished."""

from pathlib import Path

import pytest
from small_study import planned_of

from innerattn.cli.main import main
from innerattn.experiments.plan import METHODS, SITUATIONS
from innerattn.report.targets import TARGETS, write_special


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
    load = TARGETS[target].report
    assert load is not None
    left_out = ["mixed td-inner, seed 0: failed"]
    assert write_special(load(), [], tmp_path, "short", left_out) == []
    assert {path.name for path in tmp_path.iterdir()} == names - gone
    assert write_special(load(), [], tmp_path / "none", "short", []) == []


def test_what_each_target_needs() -> None:
    inner = ("td-inner", "ppo-inner")
    needs = {name: (target.methods, target.situations) for name, target in TARGETS.items()}
    assert needs["table2"] == needs["fig4"] == needs["all"] == (METHODS, SITUATIONS)
    assert needs["fig5"] == (inner, SITUATIONS)
    assert needs["crossed"] == (("td-uniform", "td-inner"), ("single", "mixed"))
    assert needs["swapped"] == (("td-uniform",), ("single", "mixed"))
    assert needs["learning"] == (METHODS, ("mixed", "double", "single"))
    assert needs["attention"] == (
        ("ppo-inner", "ppo-uniform", "mappo", "ppo-frozen", "ppo-oracle"),
        ("mixed", "mixed-8", "mixed-16"),
    )
    for name in ("learning-long", "learning-afterstates"):
        assert needs[name] == (("mappo",), ("mixed", "double", "single"))
        assert TARGETS[name].known == ("mappo", "ppo-inner", "ppo-uniform")
    assert needs["learning-ablations"] == (("ppo-inner",), ("mixed",))
    assert needs["robustness"] == (METHODS, ("mixed",))
    assert {name for name, target in TARGETS.items() if target.steps} == {"fig4", "fig5", "all"}
    assert {name for name, one in TARGETS.items() if not one.archived} == {"fig4", "fig5"}


@pytest.mark.parametrize("name", TARGETS)
def test_reports_and_runs_of_a_target_have_names_of_their_own(name: str) -> None:
    target = TARGETS[name]
    assert target.name == name
    planned = planned_of(name, seeds=2)
    assert len({one.case for one in planned}) == len(planned) > 0
    if target.report is not None:
        files = target.report().files
        assert len(set(files)) == len(files) > 0


def test_a_target_shows_further_methods_where_they_are_chosen(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command = ["reproduce", "learning", "--budget", "fast", "--report-only", "--seeds", "1"]
    assert main([*command, "--out", str(tmp_path / "all")]) == 1
    assert "mappo" not in capsys.readouterr().out
    assert main([*command, "--methods", "mappo", "--out", str(tmp_path / "one")]) == 1
    assert "mixed mappo, seed 0: missing" in capsys.readouterr().out
