"""Faults in a study: measured once, shown in tables, judged in contrasts."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import pytest
from tiny_study import TINY

from innerattn.cli.main import main
from innerattn.config import RunConfig, Scenario
from innerattn.errors import ConfigError, RunError
from innerattn.evaluate import trained
from innerattn.evaluate.faults.grid import Grid, play_all
from innerattn.experiments.archive import FILE, write_archive
from innerattn.policies import Policy, scripted_policy
from innerattn.report.study.write import write_study
from innerattn.studies.afterwards import measured, to_measure
from innerattn.studies.folder import StudyFolder, begin_study, open_study
from innerattn.studies.measurement import Measurement
from innerattn.studies.plan import plan_study
from innerattn.studies.results import read_results, read_summaries
from innerattn.studies.study import study_in
from innerattn.studies.work import work

KINDS = ("motor_gain", "unavailable")
FAULTS = TINY.replace('measure = "rescues_per_episode"', 'measure = "retained_unavailable"') + (
    '\n[faults]\nkinds = ["motor_gain", "unavailable"]\nepisodes = 4\n'
)


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("finished")
    (folder / "faults.toml").write_text(FAULTS)
    study = begin_study(folder / "faults.toml", folder / "study")
    work(study.ledger(), study.to_do)
    return folder


@pytest.fixture
def done(finished: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> StudyFolder:
    """A finished study; instead of its untrained teams, scripts meet the faults."""

    def scripted(folder: Path, worlds: Scenario) -> tuple[RunConfig, Policy]:
        name = "hungarian" if "inner" in folder.name else "greedy"
        return RunConfig(), scripted_policy(name, worlds)

    monkeypatch.setattr(trained, "load_trained", scripted)
    shutil.copytree(finished, tmp_path, dirs_exist_ok=True)
    return open_study(tmp_path / "study")


def measure(study: StudyFolder, most: int | None = None) -> list[Measurement]:
    jobs = to_measure(study)[:most]
    for job in jobs:
        job.do(lambda _: None)
    return jobs


@pytest.mark.long
def test_each_run_meets_the_faults_once(done: StudyFolder) -> None:
    assert {job.run.key for job in measure(done)} == set(done.keys)
    assert to_measure(done) == []
    for run in done.planned:
        worlds = run.config.scenario.replace(episode_steps=50)
        name = "hungarian" if run.config.train.method == "ppo-inner" else "greedy"
        grid = Grid(worlds, KINDS, episodes=4, seed=run.config.evaluate.seed)
        whole = play_all([("x", scripted_policy(name, worlds))], grid)["x"].by_kind().value
        found = measured(done, run)
        assert found["retained_motor_gain"] == pytest.approx(whole[0])
        assert found["retained_unavailable"] == pytest.approx(whole[1])
        assert found["retained"] == pytest.approx(whole.mean())
        assert 0.0 < whole.mean() < 1.0

    results = read_results(done)
    report, files = write_study(done, results)
    (compared,) = report.compared
    differences = [
        measured(done, a)["retained_unavailable"] - measured(done, b)["retained_unavailable"]  # type: ignore[operator]
        for a, b in zip(done.planned[::2], done.planned[1::2], strict=True)
    ]
    assert compared.mean == pytest.approx(sum(differences) / 3)
    page = files[0].read_text()
    assert "retained, motor gain | retained, unavailable" in page
    assert "have not met the faults" not in page
    assert [one.measured for one in read_summaries(done)] == [
        one.measured for one in results.finished
    ]


@pytest.mark.long
def test_other_faults_are_measured_anew_and_runs_without_are_told(done: StudyFolder) -> None:
    _, files = write_study(done, read_results(done))
    assert "6 of these have not met the faults" in files[0].read_text()
    measure(done, 1)
    file = done.path.parent / "faults.toml"
    file.write_text(FAULTS.replace("episodes = 4", "episodes = 5"))
    changed = begin_study(file, done.path)
    assert len(to_measure(changed)) == 6
    assert len(to_measure(done)) == 5


@pytest.mark.long
def test_the_command_measures_what_is_missing(
    done: StudyFolder, capsys: pytest.CaptureFixture[str]
) -> None:
    """In a process of its own, where the team is what it is: untrained."""
    file = done.path.parent / "faults.toml"
    file.write_text(FAULTS.replace('"motor_gain", ', "").replace("episodes = 4", "episodes = 2"))
    begun = begin_study(file, done.path)
    measure(begun, 5)
    (missing,) = to_measure(begun)
    assert main(["study", "run", str(file), "--out", str(done.path)]) == 0
    assert "retained, unavailable" in capsys.readouterr().out
    assert to_measure(begun) == []
    assert measured(begun, missing.run).keys() == {"retained", "retained_unavailable"}


@pytest.mark.long
def test_a_study_goes_on_from_its_archive(
    done: StudyFolder, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Elsewhere, without the runs and files that were measured."""
    measure(done)
    whole = read_results(done)
    first = [one for one in whole.finished if one.run.seed < 2]
    pool = tmp_path / "elsewhere"
    write_archive((one.finished for one in first if one.finished is not None), pool / FILE)
    file = done.path.parent / "faults.toml"
    on = begin_study(file, pool)
    assert [run.seed for run in on.to_do] == [2, 2]
    assert to_measure(on) == []
    found = read_results(on)
    assert [one.measured for one in found.finished] == [one.measured for one in first]
    assert all(one.measured for one in first)

    two = [one.run.key for one in whole.finished if one.run.seed == 2]
    shutil.copytree(done.runs / two[0], on.runs / two[0])
    assert main(["study", "run", str(file), "--out", str(pool), "--until", "0s"]) == 0
    assert "6 runs, 5 done, 0 failed, 1 to do" in capsys.readouterr().out
    assert measured(on, next(run for run in on.planned if run.key == two[0]))
    assert (pool / "claims" / f"{two[1]}.1").exists() is False

    file.write_text(FAULTS.replace("episodes = 4", "episodes = 5"))
    assert read_results(begin_study(file, pool)).finished[0].measured == {}  # of other faults


def test_archived_measurements_of_another_run_are_refused(
    done: StudyFolder, tmp_path: Path
) -> None:
    (job,) = measure(done, 1)
    run = next(one.finished for one in read_results(done).finished if one.run == job.run)
    assert run is not None
    altered = {name: {**document, "run": "other"} for name, document in run.beside.items()}
    write_archive([replace(run, beside=altered)], tmp_path / "elsewhere" / FILE)
    on = begin_study(done.path.parent / "faults.toml", tmp_path / "elsewhere")
    assert "not a measurement under faults" in read_results(on).left_out[0][1]


@pytest.mark.long
@pytest.mark.parametrize("text", ["", "[]", "{}", '{"run": "other", "retained": {}}', "{" * 2_000])
def test_a_damaged_file_is_named_and_its_run_left_out(text: str, done: StudyFolder) -> None:
    (job,) = measure(done, 1)
    job.path.write_text(text)
    with pytest.raises(RunError, match=r"\.json: not a measurement under faults; remove it"):
        measured(done, job.run)
    ((run, why),) = read_results(done).left_out
    assert run == job.run
    assert "not a measurement under faults" in why


@pytest.mark.long
def test_of_another_run_is_refused(done: StudyFolder) -> None:
    first, second = measure(done, 2)
    document = json.loads(second.path.read_text())
    first.path.write_text(json.dumps(document))
    with pytest.raises(RunError, match="not a measurement under faults"):
        measured(done, first.run)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[faults]\nkinds = ['blakout']", "did you mean 'blackout'?"),
        ("[faults]\nkinds = ['blackout', 'blackout']", "faults.kinds: 'blackout' stands twice"),
        ("[faults]\nkinds = []", "faults.kinds"),
        ("[faults]\nepisodes = 1", "faults.episodes"),
        ("[[tables]]\ntitle = 'a'\nmeasures = ['retained']", "it needs [faults]"),
        (
            "[faults]\nkinds = ['blackout']\n[[tables]]\ntitle = 'a'\n"
            "measures = ['retained_unavailable']",
            "must be one of score",
        ),
        (
            "[faults]\n[[tables]]\ntitle = 'a'\nmeasures = ['retained, long']",
            "has no value of long episodes",
        ),
        ("[faults]\n[search]\nppo.epochs = [1, 2]", "search: must stand without faults"),
    ],
)
def test_bad_files_are_refused_in_one_line(text: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(ConfigError) as caught:
        plan_study(study_in(text.encode(), "study.toml"), tmp_path.joinpath)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)
