"""Archived runs: a study takes them for the runs, and makes the same report of them."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from made_run import made_run
from reseal import reseal
from small_study import begin_small

from innerattn.cli.main import main
from innerattn.errors import RunError
from innerattn.experiments.archive import FILE, FORMAT, read_archive, write_archive
from innerattn.experiments.run import FinishedRun, read_run, refuse_without_steps
from innerattn.report.crossed.write import write
from innerattn.studies.results import read_results, read_summaries


def test_what_is_written_is_read_but_for_steps(runs: list[FinishedRun], tmp_path: Path) -> None:
    path = tmp_path / "new" / FILE
    write_archive(runs, path)
    archived = read_archive(path)
    assert len(archived) == len(runs)
    for run, copy in zip(runs, archived, strict=True):
        assert copy.archived
        assert (copy.case, copy.config, copy.info) == (run.case, run.config, run.info)
        assert copy.summary == run.summary
        assert copy.folder == tmp_path / "new" / "runs" / run.folder.name
        assert (copy.config_sha256, copy.scores()) == (run.config_sha256, run.scores())
        assert len(copy.scored) == len(run.scored) == 2
        for mine, its in zip(copy.scored, run.scored, strict=True):
            assert mine.rescues.dtype == its.rescues.dtype
            for name in ("rescues", "lengths", "rewards_total"):
                assert getattr(mine, name).tobytes() == getattr(its, name).tobytes()
            for name in ("policy", "scenario", "robot_names", "seed", "first_episode"):
                assert getattr(mine, name) == getattr(its, name)
            assert (mine.reward_names, mine.length) == (its.reward_names, its.length)
            assert mine.steps == {}
    with pytest.raises(RunError, match="recorded step by step"):
        refuse_without_steps(archived)
    before = path.read_bytes()
    write_archive(runs, path)
    assert path.read_bytes() == before


def test_worlds_may_need_unlike_numbers_of_helpers(runs: list[FinishedRun], tmp_path: Path) -> None:
    one = ({"name": "one", "needs": ("food",)},)
    alone = made_run(tmp_path / "made", "mixed", "td-inner", 3, keys={"scenario.tasks": one})
    for given in ([alone, runs[0]], [runs[0], alone]):
        write_archive(given, tmp_path / FILE)
        for run, copy in zip(given, read_archive(tmp_path / FILE), strict=True):
            for mine, its in zip(copy.scored, run.scored, strict=True):
                assert mine.rescues.dtype == its.rescues.dtype
                assert mine.rescues.tobytes() == its.rescues.tobytes()


def test_a_study_takes_archived_runs_for_runs(
    finished_study: Path,
    small: dict[str, object],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    methods = ("td-inner", "td-uniform")
    pool = Path(shutil.copytree(finished_study, tmp_path / "source"))
    source = read_results(begin_small("paper", pool, methods, 1, small)).runs
    pool = tmp_path / "pool"
    write_archive(source, pool / FILE)
    study = begin_small("paper", pool, methods, 2, small)
    assert list(study.states().values()) == ["done", "done", "planned", "planned"]
    assert [run.seed for run in study.to_do] == [1, 1]
    found = read_results(study)
    assert [(run.case, run.folder.name) for run in found.runs] == [
        (run.case, run.folder.name) for run in source
    ]
    assert [why for _, why in found.left_out] == ["missing", "missing"]
    assert [one.summary for one in read_summaries(study)] == [run.summary for run in source]
    assert main(["study", "status", str(study.path)]) == 0
    assert "4 runs: 2 done, 0 running, 2 waiting, 0 failed" in capsys.readouterr().out
    whole = read_results(study, steps=True, archived=False)
    assert [why for _, why in whole.left_out] == [
        *(["archived, without metrics and steps"] * 2),
        *(["missing"] * 2),
    ]
    other = begin_small("paper", pool, methods, 1, {**small, "td.polyak": 0.5})
    assert other.archived == {}
    (study.runs / study.planned[0].key).mkdir(parents=True)  # what lies in the pool comes first
    assert read_results(study).left_out[0][1].startswith("unreadable: ")


@pytest.mark.long
def test_archived_runs_give_the_same_report(
    crossed: tuple[Path, list[FinishedRun]], tmp_path: Path
) -> None:
    out, runs = crossed
    write_archive(runs, tmp_path / FILE)
    write(runs, out, "quick")
    write(read_archive(tmp_path / FILE), tmp_path, "quick")
    for name in (f"crossed.{kind}" for kind in ("md", "json", "csv")):
        assert (tmp_path / name).read_bytes() == (out / name).read_bytes()


@pytest.mark.filterwarnings("ignore::innerattn.errors.UnsealedRunWarning")  # forged: no digest
def test_what_is_no_archive_is_refused(runs: list[FinishedRun], tmp_path: Path) -> None:
    path = tmp_path / FILE
    with pytest.raises(RunError, match="missing, or not a plain file"):
        read_archive(path)
    path.write_bytes(b"PAR1, or so")
    with pytest.raises(RunError, match="not a whole Parquet file"):
        read_archive(path)
    write_archive(runs[:2], path)
    whole = path.read_bytes()
    path.write_bytes(whole[:-30])
    with pytest.raises(RunError, match="not a whole Parquet file"):
        read_archive(path)
    path.write_bytes(whole)
    (tmp_path / "link").symlink_to(path)
    with pytest.raises(RunError, match="not a plain file"):
        read_archive(tmp_path / "link")

    def rewrite(column: str, value: str, version: int = 1) -> None:
        table = pq.read_table(pa.BufferReader(whole))
        values = pa.array([value] * len(table))
        table = table.set_column(table.column_names.index(column), column, values)
        head = {"format": FORMAT, "schema_version": version, "reward_names": ["rescue"]}
        pq.write_table(table.replace_schema_metadata({FORMAT: json.dumps(head)}), path)

    rewrite("name", "run", version=2)
    with pytest.raises(RunError, match="schema version 2, only 1 is known"):
        read_archive(path)
    for column in ("config", "info", "summary"):
        rewrite(column, "{}")
        with pytest.raises(RunError, match=rf"{FILE}"):
            read_archive(path)


def test_nothing_is_written_of_runs_that_cannot_be_read(
    runs: list[FinishedRun], tmp_path: Path
) -> None:
    (tmp_path / "empty").mkdir()
    bad = replace(runs[0], read=lambda: [])
    with pytest.raises(RunError, match="holds no episodes of td-inner"):
        write_archive([runs[1], bad], tmp_path / FILE)
    rewards = replace(runs[0].recorded, reward_names=("a", "b", "c", "d"))
    with pytest.raises(RunError, match="must be the same"):
        write_archive([runs[1], replace(runs[0], read=lambda: [rewards])], tmp_path / FILE)
    assert not (tmp_path / FILE).exists()


def test_records_without_a_label_of_their_length_are_told_apart(
    runs: list[FinishedRun], tmp_path: Path
) -> None:
    """Records from before the label: of each policy, the second length begins at 0 again."""
    folder = tmp_path / "run"
    folder.mkdir()
    for name in ("config.toml", "run.json"):
        (folder / name).write_bytes((runs[0].folder / name).read_bytes())
    (folder / "evaluation").mkdir()
    for file in (runs[0].folder / "evaluation").iterdir():
        target = folder / "evaluation" / file.name
        if file.suffix != ".parquet":
            target.write_bytes(file.read_bytes())
            continue
        table = pq.read_table(file)
        head = json.loads(table.schema.metadata[b"innerattn.records"])
        for record in head["records"]:
            assert record.pop("length") in ("standard", "long")
        metadata = {"innerattn.records": json.dumps(head)}
        pq.write_table(table.replace_schema_metadata(metadata), target)
    reseal(folder)
    older = read_run(runs[0].case, folder)
    assert [record.num_episodes for record in older.scored] == [
        record.num_episodes for record in runs[0].scored
    ]
    assert np.array_equal(older.scored[1].rescues, runs[0].scored[1].rescues)
