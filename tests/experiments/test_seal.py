"""`innerattn seal` gives a manifest to a run that has none, if all of it can be read."""

import json
import os
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from small_study import run_in

from innerattn.cli.main import main
from innerattn.config import load_run_config
from innerattn.errors import InnerattnError, RunError, UnsealedRunWarning
from innerattn.experiments.archive import FILE, FORMAT, read_archive, seal_archive, write_archive
from innerattn.experiments.plan import Case
from innerattn.experiments.run import FinishedRun, read_run
from innerattn.experiments.seal import seal_run
from innerattn.records.run_files import RunFiles
from innerattn.records.tables import read_table
from innerattn.train import Progress, load_policy, train

FILES = (
    *("config.toml", "run.json", "metrics.jsonl", "checkpoints/latest"),
    *("checkpoints/96/weights.safetensors", "evaluation/summary.json"),
    *("evaluation/episodes.parquet", "evaluation/rescues.parquet"),
)


def unseal(run: Path) -> Path:
    """Make a run what an older version left."""
    (run / "manifest.json").unlink()
    info = run / "run.json"
    info.write_text(info.read_text().replace('"sealed": true', '"sealed": false'))
    return run


@pytest.fixture
def run(study: Path) -> Path:
    return unseal(run_in(study, "td-inner"))


def test_a_sealed_run_is_checked_from_then_on(
    run: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (run / "replay.html").write_text("<p>a page")
    with pytest.warns(UnsealedRunWarning):
        load_policy(run)
    before = {name: (run / name).read_bytes() for name in FILES if name != "run.json"}
    assert main(["seal", str(run)]) == 0
    said = capsys.readouterr().out
    assert f"{run}: sealed 9 files, " in said
    assert "checked: configuration, 1 files of weights and checkpoints, 1 lines of metrics" in said
    assert "nothing reads them: replay.html" in said
    assert {name: (run / name).read_bytes() for name in before} == before
    load_policy(run)  # without a warning, which would be an error
    read_run(Case("mixed", "td-inner", 0), run).read()
    config = run / "config.toml"
    config.write_text(config.read_text() + "# another\n")
    with pytest.raises(RunError, match=r"config\.toml: is not the file that manifest\.json names"):
        load_policy(run)


def test_a_run_that_was_changed_on_purpose_is_sealed_anew(run: Path) -> None:
    """The remedy of the message: remove manifest.json, and seal."""
    seal_run(run)
    config = run / "config.toml"
    whole = config.read_text()
    config.write_text(f"{whole}# changed on purpose\n")
    with pytest.raises(RunError, match="it was altered"):
        load_policy(run)
    (run / "manifest.json").unlink()
    with pytest.raises(RunError, match=r"manifest\.json"):
        load_policy(run)  # nobody but seal does without it
    info = (run / "run.json").read_bytes()
    config.write_text("[")
    with pytest.raises(InnerattnError, match=r"config\.toml"):
        seal_run(run)
    assert (run / "run.json").read_bytes() == info
    config.write_text(f"{whole}# changed on purpose\n")
    assert main(["seal", str(run)]) == 0
    load_policy(run)


@pytest.mark.parametrize("name", FILES)
def test_a_damaged_run_is_not_sealed(run: Path, name: str) -> None:
    whole = (run / name).read_bytes()
    (run / name).write_bytes(whole[: len(whole) // 2])
    info = (run / "run.json").read_bytes()
    with pytest.raises((InnerattnError, OSError), match=name.rpartition("/")[2].partition(".")[0]):
        seal_run(run)
    assert not (run / "manifest.json").exists()
    assert (run / "run.json").read_bytes() == info
    (run / name).write_bytes(whole)
    seal_run(run)


def test_what_is_sealed_or_not_over_is_refused(
    run: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (run / "link").symlink_to(run / "run.json")
    with pytest.raises(RunError, match="link: is neither a plain file nor a folder"):
        seal_run(run)
    (run / "link").unlink()
    seal_run(run)
    assert main(["seal", str(run)]) == 1
    assert capsys.readouterr().err.endswith(f"{run}: has a manifest.json already\n")
    info = run / "run.json"
    unseal(run)
    info.write_text(info.read_text().replace('"done"', '"running"'))
    with pytest.raises(RunError, match="go on with: innerattn train --resume"):
        seal_run(run)
    with pytest.raises(RunError, match="no such run folder"):
        seal_run(run / "nothing")


@pytest.mark.parametrize("damaged", ["state.safetensors", "rows", "checkpoint.json"])
def test_checkpoints_of_an_interrupted_run_are_read(
    small: dict[str, object], tmp_path: Path, damaged: str
) -> None:
    def stop(now: Progress) -> None:
        if now.env_steps >= 72:
            raise KeyboardInterrupt

    run = tmp_path / "run"
    often = {**small, "train.checkpoint_every_env_steps": 24, "train.checkpoint_every_minutes": 0.0}
    with pytest.raises(KeyboardInterrupt):
        train(load_run_config("mixed", overrides=often), run, progress=stop)
    unseal(run)
    folder = run / "checkpoints"
    name = min(os.listdir(folder / "rows")) if damaged == "rows" else f"72/{damaged}"
    file = folder / "rows" / name if damaged == "rows" else folder / name
    whole = file.read_bytes()
    flipped = bytearray(whole)
    flipped[len(whole) // 2] ^= 4
    file.write_bytes(flipped)
    with pytest.raises(RunError, match=file.name):
        seal_run(run)
    file.write_bytes(whole)
    sealed = seal_run(run)
    assert RunFiles(run).info.sealed
    assert f"checkpoints/{name}" in sealed.files or damaged == "rows"


def contents(path: Path) -> list[object]:
    """All that an archive says."""
    names = ("rescues", "lengths", "rewards_total")
    return [
        (
            *(one.case, one.config, one.info, one.summary),
            [getattr(record, name).tobytes() for record in one.read() for name in names],
        )
        for one in read_archive(path)
    ]


def older(path: Path) -> None:
    """Make an archive what an older version wrote."""
    table, head = read_table(path.read_bytes(), path, FORMAT, 1)
    del head["sha256"]
    text = json.dumps(head)
    pq.write_table(table.replace_schema_metadata({FORMAT: text}), path, compression="zstd")


def test_an_older_archive_is_read_with_a_warning_and_sealed(
    runs: list[FinishedRun], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / FILE
    write_archive(runs, path)
    expected = contents(path)
    older(path)
    with pytest.warns(UnsealedRunWarning, match="holds no digest; its runs are read unchecked"):
        read_archive(path)
    assert main(["seal", str(path)]) == 0
    assert capsys.readouterr().out == f"{path}: sealed {len(runs)} runs\n"
    assert contents(path) == expected  # without a warning, which would be an error
    with pytest.raises(RunError, match="holds the digest of its contents already"):
        seal_archive(path)


def test_an_archive_with_a_broken_text_is_refused(runs: list[FinishedRun], tmp_path: Path) -> None:
    path = tmp_path / FILE
    write_archive(runs, path)
    table = pq.read_table(path)
    broken = pa.array([b"mixed\x9b"] * len(table), pa.binary()).view(pa.string())
    place = table.column_names.index("situation")
    pq.write_table(table.set_column(place, table.schema.field(place), broken), path)
    with pytest.raises(RunError, match="does not fit its own digest"):
        read_archive(path)


def test_an_archive_with_other_columns_is_refused(runs: list[FinishedRun], tmp_path: Path) -> None:
    path = tmp_path / FILE
    write_archive(runs, path)
    table = pq.read_table(path)
    seeds, place = table["seed"].cast(pa.int32()), table.column_names.index("seed")
    for other, told in (
        (table.set_column(place, "seed", seeds), "column 'seed' holds int32: must hold int64"),
        (table.append_column("seed", table["seed"]), "two columns have the same name"),
    ):
        pq.write_table(other, path)
        with pytest.raises(RunError, match=told):
            read_archive(path)


@pytest.mark.parametrize("count", [30, pytest.param(1000, marks=pytest.mark.slow)])
def test_no_flipped_bit_of_an_archive_changes_what_is_read(
    runs: list[FinishedRun], tmp_path: Path, count: int
) -> None:
    path = tmp_path / FILE
    write_archive(runs, path)
    whole, chance = path.read_bytes(), np.random.default_rng(0)
    expected, refused = contents(path), 0
    for at, bit in zip(
        chance.integers(0, len(whole), count), chance.integers(0, 8, count), strict=True
    ):
        flipped = bytearray(whole)
        flipped[at] ^= 1 << int(bit)
        path.write_bytes(flipped)
        try:
            found = contents(path)
        except RunError:
            refused += 1
        else:
            assert found == expected  # a byte that says nothing
    assert refused
