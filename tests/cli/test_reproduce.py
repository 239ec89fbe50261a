"""`innerattn reproduce`: trains what is missing, uses what is as planned, and names the rest."""

import json
import re
import shutil
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from in_turn import do_in_turn
from reseal import reseal
from small_study import Command, run_in, times

from innerattn.cli.main import main
from innerattn.experiments.robustness import design

TD = "td-inner,td-uniform"


def document(out: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((out / "report.json").read_text())
    return found


@pytest.mark.usefixtures("in_this_process")
def test_finished_runs_are_used_and_the_missing_ones_trained(
    study: Path, command: Command, capsys: pytest.CaptureFixture[str]
) -> None:
    before = times(study / "runs")
    before = {path: time for path, time in before.items() if path != study / "runs"}
    assert command("table2", study, TD, "--seeds", "2") == 0
    out, err = capsys.readouterr()
    where = study / "table2"
    assert out.startswith(f"{where}: 4 runs, 2 done, 0 failed, 2 to do by 2 workers\n")
    assert out.count("a smoke run, no result") == 1
    assert err == ""
    made = ["report.md", "claims.md", "runs.csv", "table2.csv", "table2.json", "table2.md"]
    assert f"Written: {where / made[0]}, {', '.join(made[1:])}\n" in out
    texts = {name: (where / name).read_text() for name in made}
    assert all("a smoke run, no result" in text for text in texts.values())
    assert "Left out" not in texts["report.md"]
    assert not list(where.glob("fig*"))
    listed = {line.split(",")[3] for line in texts["runs.csv"].splitlines()[1:]}
    assert listed == {f"runs/{path.name}" for path in (study / "runs").iterdir()}

    trained = times(study / "runs")
    assert before.items() <= trained.items()
    assert command("table2", study, TD, "--seeds", "2") == 0
    again = capsys.readouterr().out
    assert again.startswith(f"{where}: 4 runs, 4 done, 0 failed, 0 to do\n")
    assert again.splitlines()[1:] == out.splitlines()[1:]
    assert times(study / "runs") == trained
    assert {name: (where / name).read_text() for name in made} == texts


def test_a_page_about_the_finished_runs(
    study: Path, command: Command, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    page = tmp_path / "study.html"
    options = ["--seeds", "1", "--report-only", "--page", str(page)]
    assert command("table2", study, TD, *options) == 0
    assert capsys.readouterr().out.count(f"Written: {page}\n") == 1
    text = page.read_text("utf-8")
    assert "a smoke run, no result" in text
    assert all(f"{run_in(study, name).name} (seed 0)" in text for name in TD.split(","))
    for wrong, message in (
        (["crossed", study, "td-inner"], "--page: runs of crossed differ by more than a page"),
        (["table2", study, "td-inner"], "--page x.pdf: must end in .html"),
    ):
        file = "x.pdf" if "x.pdf" in message else str(page)
        assert command(*wrong, "--report-only", "--page", file) == 2
        assert message in capsys.readouterr().err


@pytest.mark.long
@pytest.mark.usefixtures("in_this_process")
def test_runs_are_trained_on_a_device_and_reported_from_any(
    study: Path, command: Command, capsys: pytest.CaptureFixture[str]
) -> None:
    options = ["learning", study, TD, "--seeds", "2"]
    assert command(*options, "--device", "abacus") == 1
    assert "train.device = 'abacus': not usable here" in capsys.readouterr().err
    assert len(list((study / "runs").iterdir())) == 2
    assert command(*options, "--device", "cpu:0") == 0  # not how the finished ones were trained
    assert "4 runs, 2 done, 0 failed, 2 to do" in capsys.readouterr().out
    assert command(*options, "--report-only") == 0
    runs = document(study / "learning")["runs"]
    assert sorted(run["device"] for run in runs) == ["cpu", "cpu", "cpu:0", "cpu:0"]


def test_a_run_that_was_changed_is_named_and_neither_used_nor_changed(
    study: Path, command: Command, capsys: pytest.CaptureFixture[str]
) -> None:
    foreign = run_in(study, "td-inner")
    config = foreign / "config.toml"
    config.write_text(config.read_text().replace("polyak = 0.02\n", "polyak = 0.03\n"))
    reseal(foreign)
    before = times(foreign)
    assert command("table2", study, TD, "--seeds", "1") == 1
    out, _ = capsys.readouterr()
    why = "unreadable: its configuration is another than its name says"
    assert "2 runs, 2 done, 0 failed, 0 to do" in out
    assert f"  mixed td-inner, seed 0: {why}\n" in out
    assert times(foreign) == before
    report = (study / "table2" / "report.md").read_text()
    assert f"**Left out of all results:**\n\n- mixed td-inner, seed 0: {why}" in report


def test_a_report_alone_trains_nothing_and_names_what_is_missing(
    study: Path, command: Command, capsys: pytest.CaptureFixture[str]
) -> None:
    missing, there = (run_in(study, method) for method in TD.split(","))
    shutil.rmtree(missing)
    shutil.rmtree(study / "claims")
    before = times(there)
    assert command("table2", study, TD, "--seeds", "1", "--report-only") == 1
    out, err = capsys.readouterr()
    assert err == ""
    assert "  mixed td-inner, seed 0: missing\n" in out
    assert not missing.exists()
    assert times(there) == before
    assert "- mixed td-inner, seed 0: missing\n" in (study / "table2" / "report.md").read_text()


@pytest.mark.usefixtures("in_this_process")
def test_the_same_command_makes_the_same_files_from_nothing(
    tmp_path: Path, command: Command
) -> None:
    one, other = tmp_path / "one", tmp_path / "other"
    for out in (one, other):
        assert command("all", out, TD, "--seeds", "1") == 0
    made = {path.name for path in (one / "all").iterdir()} - {"rules.json"}  # it has the time
    assert {"report.md", "table2.csv", "table2.json", "fig4.pdf", "study.toml"} <= made
    for name in made:
        assert (one / "all" / name).read_bytes() == (other / "all" / name).read_bytes(), name


def test_runs_with_names_of_an_earlier_version_are_taken_over(
    study: Path, command: Command, capsys: pytest.CaptureFixture[str]
) -> None:
    for method in TD.split(","):
        run_in(study, method).rename(study / "runs" / f"mixed-{method}-quick-s0")
    foreign = study / "runs" / "mixed-mappo-quick-s0"
    foreign.mkdir()
    shutil.rmtree(study / "claims")
    assert command("table2", study, "td-inner", "--seeds", "1", "--report-only") == 0
    assert capsys.readouterr().err == ""
    names = {path.name for path in (study / "runs").iterdir()}
    assert names == {foreign.name, "mixed-td-uniform-quick-s0", run_in(study, "td-inner").name}
    assert re.search("-[0-9a-f]{16}$", run_in(study, "td-inner").name)
    assert command("learning", study, TD, "--seeds", "1", "--report-only") == 0
    assert len(document(study / "learning")["runs"]) == 2


@pytest.mark.usefixtures("in_this_process")
def test_the_crossed_design_has_runs_and_files_of_its_own(
    tmp_path: Path, command: Command, capsys: pytest.CaptureFixture[str]
) -> None:
    assert command("crossed", tmp_path, "td-uniform", "--seeds", "1") == 0
    out, err = capsys.readouterr()
    assert "2 runs, 0 done, 0 failed, 2 to do" in out
    assert err == ""
    files = {f"crossed.{kind}" for kind in ("csv", "json", "md", "pdf", "png")}
    files |= {"crossed_seeds.pdf", "crossed_seeds.png", "crossed_tables.md"}
    assert files < {path.name for path in (tmp_path / "crossed").iterdir()}
    found = json.loads((tmp_path / "crossed" / "crossed.json").read_text())
    (situation,) = found["situations"]
    assert sorted(run["credit"] for run in situation["runs"]) == ["helpers", "team"]


@pytest.mark.usefixtures("in_this_process")
def test_targets_share_runs_and_have_a_report_each(
    study: Path, command: Command, capsys: pytest.CaptureFixture[str]
) -> None:
    assert command("learning", study, TD, "--seeds", "1") == 0
    out, err = capsys.readouterr()
    assert "2 runs, 2 done, 0 failed, 0 to do" in out
    assert command("learning-entities", study, "td-inner", "--seeds", "1") == 0
    out, err = capsys.readouterr()
    assert "1 run, 0 done, 0 failed, 1 to do by 1 worker\n" in out
    assert err == ""
    for name, count in (("learning", 2), ("learning-entities", 1)):
        assert len(document(study / name)["runs"]) == count
        assert f"{count} of {count} runs are done." in (study / name / "report.md").read_text()
    assert len(list((study / "runs").iterdir())) == 3


@pytest.mark.usefixtures("in_this_process")
def test_a_run_that_diverges_is_named_and_the_others_are_trained(
    tmp_path: Path, command: Command, capsys: pytest.CaptureFixture[str]
) -> None:
    for _ in range(2):  # it is not tried a fourth time
        assert command("fig5", tmp_path, "all", "--seeds", "1", **{"td.reward_scale": 1e-37}) == 1
        out, _ = capsys.readouterr()
        assert "  mixed td-inner, seed 0: failed: training diverged at " in out
        assert len(list((tmp_path / "runs").iterdir())) == 1
        assert len(list((tmp_path / "claims").glob("*.failed"))) == 3


def test_ctrl_c_keeps_what_is_finished(
    study: Path,
    command: Command,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def press_ctrl_c(workers: Sequence[object], *_: object, **__: object) -> None:
        assert len(workers) == 1
        raise KeyboardInterrupt

    monkeypatch.setattr("innerattn.studies.launch.local.run_side_by_side", press_ctrl_c)
    before = times(study / "runs")
    assert command("fig5", study, "td-inner", "--seeds", "2") == 130
    assert capsys.readouterr().err.splitlines()[-1] == "innerattn: interrupted"
    assert times(study / "runs") == before


@pytest.fixture
def few_faults(monkeypatch: pytest.MonkeyPatch) -> None:
    """Robustness is measured by one kind of fault in few worlds, in this process."""

    def few(cases: list[design.Case]) -> list[design.Group]:
        return [replace(one, kinds=("blackout",), episodes=3) for one in design.groups(cases)]

    monkeypatch.setattr("innerattn.experiments.robustness.measurement.groups", few)
    monkeypatch.setattr("innerattn.experiments.processes.run_side_by_side", do_in_turn)


@pytest.mark.long
@pytest.mark.usefixtures("few_faults")
def test_robustness_is_measured_once_and_then_read(
    study: Path,
    command: Command,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    robustness = partial(command, "robustness", study, "td-uniform", "--seeds", "1")
    where = study / "robustness"
    assert robustness("--report-only") == 1
    out, err = capsys.readouterr()
    assert "  faults of mixed-s0: not measured\n" in out
    assert "- faults of mixed-s0: not measured\n" in (where / "robustness.md").read_text()
    assert not (where / "faults").exists()

    assert robustness() == 0
    out, err = capsys.readouterr()
    assert "1 run, 1 done, 0 failed, 0 to do\n" in out
    assert all("% |" in line for line in err.splitlines()), "progress alone, where it takes long"
    (measured,) = (where / "faults").iterdir()
    texts = [(where / name).read_bytes() for name in ("robustness.json", "robustness.md")]
    assert b"not measured" not in texts[1]
    assert json.loads(texts[0])["deployments"][0]["kinds"] == ["blackout"]

    def refuse(*_: object, **__: object) -> None:
        raise AssertionError("it was measured again")

    monkeypatch.setattr("innerattn.evaluate.robustness.measure_robustness", refuse)
    before = times(measured)
    for options in ([], ["--report-only"]):
        assert robustness(*options) == 0
        now = [(where / name).read_bytes() for name in ("robustness.json", "robustness.md")]
        assert now == texts
        assert times(measured) == before


@pytest.mark.usefixtures("few_faults")
def test_ctrl_c_while_faults_are_measured_keeps_the_runs(
    study: Path,
    command: Command,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def press_ctrl_c(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("innerattn.experiments.processes.run_side_by_side", press_ctrl_c)
    before = times(study / "runs")
    assert command("robustness", study, "td-uniform", "--seeds", "1") == 130
    assert capsys.readouterr().err.splitlines()[-1] == "innerattn: interrupted"
    assert times(study / "runs") == before


@pytest.mark.usefixtures("few_faults")
def test_a_measurement_that_fails_is_named(
    study: Path, command: Command, capsys: pytest.CaptureFixture[str]
) -> None:
    run = run_in(study, "td-uniform")
    shutil.rmtree(run / "checkpoints")
    assert command("robustness", study, "td-uniform", "--seeds", "1") == 1
    out, err = capsys.readouterr()
    reason = f"{run}: holds no checkpoint yet"
    assert err == f"innerattn: error: faults of mixed-s0: {reason}\n"
    assert f"  faults of mixed-s0: {reason}\n" in out


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["fig5", "--methods", "td-unifor"], "--methods = 'td-unifor': must be all or of td-i"),
        (["all", "--presets", "mixed,x"], "--presets = 'x': must be all or of single, "),
        (["all", "--situations", "mixed,x"], "--presets = 'x': must be all or of single, "),
        (["all", "--seeds", "0"], "--seeds = 0: must be 1 to 1,000"),
    ],
)
def test_wrong_options_are_one_line(
    options: list[str],
    message: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["reproduce", *options]) == 2
    assert capsys.readouterr().err.startswith(f"innerattn: error: {message}")
    assert list(tmp_path.iterdir()) == []


def test_an_unknown_target_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["reproduce", "table3"])
    assert ended.value.code == 2
    assert "table3" in capsys.readouterr().err
