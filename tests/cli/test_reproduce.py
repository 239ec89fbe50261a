"""`innerattn reproduce`: trains what is missing, uses what is as planned, and names the rest."""

import json
import shutil
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest
from in_turn import do_in_turn
from reseal import reseal
from small_study import NAMES, Command, account, states, times

from innerattn.cli.main import main
from innerattn.experiments.robustness import design


@pytest.mark.usefixtures("in_this_process")
def test_finished_runs_are_used_and_the_missing_ones_trained(
    study: Path, command: Command, capsys: pytest.CaptureFixture[str]
) -> None:
    before = times(study / "runs" / NAMES[0]) | times(study / "runs" / NAMES[1])
    assert command("table2", study, "td-inner,td-uniform", "--seeds", "2") == 0
    out, err = capsys.readouterr()
    assert out.startswith("table2, budget quick: 4 runs of 2 seeds; 2 finished, 2 to train, ")
    assert out.count("a smoke run, no result") == 2
    assert err == ""
    rows = [line.split() for line in out.splitlines()]
    assert ["td-inner", "2", "of", "2"] in [row[:4] for row in rows]
    assert f"Written: {study / 'runs.json'}\n" in out

    document = account(study)
    assert "no result" in document["note"]
    assert (document["target"], document["budget"]) == ("table2", "quick")
    assert (document["seeds"], document["situations"]) == ([0, 1], ["mixed"])
    for run in document["runs"]:
        summary = json.loads((study / run["folder"] / "evaluation" / "summary.json").read_text())
        info = json.loads((study / run["folder"] / "run.json").read_text())
        assert run["state"] == "finished"
        assert run["rescues_per_episode"] == summary["rescues_per_episode"]["mean"]
        assert len(run["config_sha256"]) == len(run["weights_sha256"]) == 64
        assert (run["commit"], run["versions"]) == (info["commit"], info["versions"])

    made = ["report.md", "claims.md", "runs.csv", "table2.csv", "table2.json", "table2.md"]
    assert document["outputs"] == made
    texts = {name: (study / name).read_text() for name in made}
    assert all("a smoke run, no result" in text for text in texts.values())
    assert "Left out" not in texts["report.md"]
    assert not list(study.glob("fig*"))

    trained = times(study / "runs")
    assert before.items() <= trained.items()
    assert command("table2", study, "td-inner,td-uniform", "--seeds", "2") == 0
    again = capsys.readouterr().out
    assert again.startswith("table2, budget quick: 4 runs of 2 seeds; 4 finished, 0 to train\n")
    assert again.splitlines()[3:] == out.splitlines()[3:]
    assert times(study / "runs") == trained
    assert account(study) == document
    assert {name: (study / name).read_text() for name in made} == texts


def test_a_page_about_the_finished_runs(
    study: Path, command: Command, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    page = tmp_path / "study.html"
    options = ["--seeds", "1", "--report-only", "--page", str(page)]
    assert command("table2", study, "td-inner,td-uniform", *options) == 0
    assert capsys.readouterr().out.count(f"Written: {page}\n") == 1
    text = page.read_text("utf-8")
    assert "a smoke run, no result" in text
    assert all(f"{name} (seed 0)" in text for name in NAMES)
    for wrong, message in (
        (["crossed", study, "td-inner"], "--page: runs of crossed differ by more than a page"),
        (["table2", study, "td-inner"], "--page x.pdf: must end in .html"),
    ):
        file = "x.pdf" if "x.pdf" in message else str(page)
        assert command(*wrong, "--report-only", "--page", file) == 2
        assert message in capsys.readouterr().err


@pytest.mark.usefixtures("in_this_process")
def test_runs_are_trained_on_a_device_and_reported_from_any(
    study: Path, command: Command, capsys: pytest.CaptureFixture[str]
) -> None:
    options = ["table2", study, "td-inner,td-uniform", "--seeds", "2"]
    assert command(*options, "--device", "abacus") == 1
    assert "train.device = 'abacus': not usable here" in capsys.readouterr().err
    assert not (study / "runs.json").exists()
    assert command(*options, "--device", "cpu:0") == 0  # not how the finished ones were trained
    assert "2 finished, 2 to train" in capsys.readouterr().out
    assert command(*options, "--report-only") == 0
    assert [run["device"] for run in account(study)["runs"]] == ["cpu", "cpu", "cpu:0", "cpu:0"]


@pytest.mark.usefixtures("in_this_process")
def test_another_configuration_is_named_and_neither_used_nor_changed(
    study: Path, command: Command, capsys: pytest.CaptureFixture[str]
) -> None:
    foreign = study / "runs" / NAMES[0]
    config = foreign / "config.toml"
    config.write_text(config.read_text().replace("polyak = 0.02\n", "polyak = 0.03\n"))
    reseal(foreign)
    before = times(foreign)
    assert command("fig4", study, "td-inner,td-uniform", "--seeds", "2") == 1
    out, err = capsys.readouterr()
    why = "other configuration: td.polyak = 0.03, planned 0.02"
    assert err == f"innerattn: left out: {foreign}: {why} (move it away to have it trained)\n"
    assert "4 runs of 2 seeds; 1 finished, 2 to train" in out
    assert "; 1 left out\n" in out
    assert f"  mixed td-inner seed 0: {why}\n" in out
    (row,) = [line.split() for line in out.splitlines() if line.split()[:1] == ["td-inner"]]
    assert row[1:4] == ["1", "of", "2"]
    assert "±" not in row
    assert times(foreign) == before
    assert states(study) == ["other_configuration", "finished", "finished", "finished"]
    assert account(study)["runs"][0]["why"] == "td.polyak = 0.03, planned 0.02"
    assert (
        f"**Left out of all results:**\n\n- mixed td-inner seed 0: {why}"
        in (study / "report.md").read_text()
    )


def test_a_report_alone_trains_nothing_and_names_what_is_missing(
    study: Path, command: Command, capsys: pytest.CaptureFixture[str]
) -> None:
    missing, there = (study / "runs" / name for name in NAMES)
    shutil.rmtree(missing)
    before = times(there)
    assert command("table2", study, "td-inner,td-uniform", "--seeds", "1", "--report-only") == 1
    out, err = capsys.readouterr()
    assert err == ""
    assert out.startswith("table2, budget quick: 2 runs of 1 seed; 1 finished, 1 not\n")
    assert "  mixed td-inner seed 0: missing\n" in out
    assert not missing.exists()
    assert times(there) == before
    assert states(study) == ["missing", "finished"]
    assert "- mixed td-inner seed 0: missing\n" in (study / "report.md").read_text()


@pytest.mark.usefixtures("in_this_process")
def test_the_same_command_makes_the_same_files_from_nothing(
    tmp_path: Path, command: Command
) -> None:
    one, other = tmp_path / "one", tmp_path / "other"
    for out in (one, other):
        assert command("all", out, "td-inner,td-uniform", "--seeds", "1") == 0
    made = account(one)["outputs"]
    assert {"report.md", "table2.csv", "table2.json", "fig4.pdf"} <= set(made)
    for name in made:
        assert (one / name).read_bytes() == (other / name).read_bytes(), name


@pytest.mark.usefixtures("in_this_process")
def test_the_crossed_design_has_runs_and_files_of_its_own(
    tmp_path: Path, command: Command, capsys: pytest.CaptureFixture[str]
) -> None:
    assert command("crossed", tmp_path, "td-uniform", "--seeds", "1") == 0
    out, err = capsys.readouterr()
    assert out.startswith("crossed, budget quick: 2 runs of 1 seed; 0 finished, 2 to train, ")
    assert err == ""
    rows = [" ".join(line.split()[:5]) for line in out.splitlines()]
    assert "td-uniform helpers 1 of 1" in rows
    assert "td-uniform team 1 of 1" in rows
    document = account(tmp_path)
    files = [f"crossed.{kind}" for kind in ("csv", "json", "md", "pdf", "png")]
    files += ["crossed_seeds.pdf", "crossed_seeds.png", "crossed_tables.md"]
    assert (document["target"], document["outputs"]) == ("crossed", files)
    assert [run["variant"] for run in document["runs"]] == ["helpers", "team"]
    assert {path.name for path in (tmp_path / "runs").iterdir()} == {
        f"mixed-td-uniform-{credit}-quick-s0" for credit in ("helpers", "team")
    }


@pytest.mark.usefixtures("in_this_process")
def test_variants_of_learning_have_runs_and_files_of_their_own(
    study: Path, command: Command, capsys: pytest.CaptureFixture[str]
) -> None:
    assert command("learning", study, "td-inner,td-uniform", "--seeds", "1") == 0
    out, err = capsys.readouterr()
    assert out.startswith("learning, budget quick: 2 runs of 1 seed; 2 finished, 0 to train\n")
    assert account(study)["outputs"] == ["learning.json", "learning.md"]  # no episode ended
    assert command("learning-entities", study, "td-inner", "--seeds", "1") == 0
    out, err = capsys.readouterr()
    assert "1 run of 1 seed; 0 finished, 1 to train, 1 at a time\n" in out
    assert err == ""
    assert ["td-inner", "entities", "1", "of", "1"] in [
        line.split()[:5] for line in out.split("\n")
    ]
    assert account(study)["outputs"] == ["learning_entities.json", "learning_entities.md"]
    assert (study / "runs" / "mixed-td-inner-entities-quick-s0").is_dir()
    assert "| td-inner entities, mixed |" in (study / "learning_entities.md").read_text()
    assert "| td-inner, mixed |" in (study / "learning.md").read_text()


@pytest.fixture
def few_faults(monkeypatch: pytest.MonkeyPatch) -> None:
    """Robustness is measured by one kind of fault in few worlds, in this process."""

    def few(cases: list[design.Case]) -> list[design.Group]:
        return [replace(one, kinds=("blackout",), episodes=3) for one in design.groups(cases)]

    monkeypatch.setattr("innerattn.experiments.robustness.measurement.groups", few)
    monkeypatch.setattr("innerattn.experiments.processes.run_side_by_side", do_in_turn)


@pytest.mark.usefixtures("few_faults")
def test_robustness_is_measured_once_and_then_read(
    study: Path,
    command: Command,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    robustness = partial(command, "robustness", study, "td-uniform", "--seeds", "1")
    assert robustness("--report-only") == 1
    out, err = capsys.readouterr()
    assert "  faults of mixed-s0: not measured\n" in out
    assert "- faults of mixed-s0: not measured\n" in (study / "robustness.md").read_text()
    assert not (study / "faults").exists()

    assert robustness() == 0
    out, err = capsys.readouterr()
    assert out.startswith("robustness, budget quick: 1 run of 1 seed; 1 finished, 0 to train\n")
    assert err == ""
    files = ["robustness.json", "robustness.md"]
    assert account(study)["outputs"] == files
    (document,) = (study / "faults").iterdir()
    texts = [(study / name).read_bytes() for name in files]
    assert b"not measured" not in texts[1]
    assert json.loads(texts[0])["deployments"][0]["kinds"] == ["blackout"]

    def refuse(*_: object, **__: object) -> None:
        raise AssertionError("it was measured again")

    monkeypatch.setattr("innerattn.evaluate.robustness.measure_robustness", refuse)
    before = times(document)
    for options in ([], ["--report-only"]):
        assert robustness(*options) == 0
        assert [(study / name).read_bytes() for name in files] == texts
        assert times(document) == before


@pytest.mark.usefixtures("few_faults")
def test_a_measurement_that_fails_is_named(
    study: Path, command: Command, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.rmtree(study / "runs" / NAMES[1] / "checkpoints")
    assert command("robustness", study, "td-uniform", "--seeds", "1") == 1
    out, err = capsys.readouterr()
    reason = f"{study / 'runs' / NAMES[1]}: holds no checkpoint yet"
    assert err == f"innerattn: error: faults of mixed-s0: {reason}\n"
    assert f"  faults of mixed-s0: {reason}\n" in out


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["fig5", "--methods", "td-uniform"], "--methods = 'td-uniform': must be all or of td-i"),
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
