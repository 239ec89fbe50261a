"""Files of a run that were cut, changed or replaced: a typed error that names the file."""

import os
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from reseal import reseal
from small_study import run_in

from innerattn.errors import InnerattnError, RunError, UnsealedRunWarning
from innerattn.experiments.plan import Case
from innerattn.experiments.run import read_metrics, read_run
from innerattn.experiments.side_by_side import Run
from innerattn.records import read_records
from innerattn.records.run_files import RunFiles, amend
from innerattn.records.run_folder import read_config
from innerattn.train import load_policy

SHORT, FULL = 20, 1000
FILES = (
    *("config.toml", "run.json", "manifest.json", "metrics.jsonl"),
    *("checkpoints/latest", "checkpoints/96/weights.safetensors"),
    *("evaluation/summary.json", "evaluation/episodes.parquet", "evaluation/rescues.parquet"),
)


@pytest.fixture
def run(study: Path) -> Path:
    return run_in(study, "td-inner")


def read_all(run: Path) -> None:
    """Read every file of a run by whoever reads it."""
    load_policy(run)
    found = read_run(Case("mixed", "td-inner", 0), run)
    read_metrics(found, "env_steps", "losses")
    read_records(run / "evaluation")


def test_a_whole_run_is_read(run: Path) -> None:
    read_all(run)
    assert sorted(
        path.relative_to(run).as_posix() for path in run.rglob("*") if path.is_file()
    ) == (sorted(FILES))


def refuse(run: Path, name: str, damaged: bytes) -> None:
    """The reading ends with an error of ours that names the file, in one line."""
    (run / name).write_bytes(damaged)
    with pytest.raises(InnerattnError) as caught:
        read_all(run)
    text = str(caught.value)
    assert "\n" not in text or name == "config.toml"
    told = {name.rpartition("/")[2], "manifest.json"}  # a manifest tells of other files, too
    assert any(one in text for one in told), text


def damages(whole: bytes, count: int, chance: np.random.Generator) -> list[bytes]:
    """As many truncations and as many flips of a bit."""
    cut = [whole[: int(at)] for at in chance.integers(0, len(whole), count)]
    for at, bit in zip(
        chance.integers(0, len(whole), count), chance.integers(0, 8, count), strict=True
    ):
        flipped = bytearray(whole)
        flipped[at] ^= 1 << int(bit)
        cut.append(bytes(flipped))
    return cut


@pytest.mark.parametrize("name", FILES)
@pytest.mark.parametrize("count", [SHORT, pytest.param(FULL, marks=pytest.mark.slow)])
def test_no_cut_and_no_flipped_bit_is_read(run: Path, name: str, count: int) -> None:
    whole = (run / name).read_bytes()
    for damaged in damages(whole, count, np.random.default_rng(len(name))):
        refuse(run, name, damaged)
    (run / name).write_bytes(whole)
    read_all(run)


@pytest.mark.parametrize("name", FILES)
@pytest.mark.parametrize("change", ["missing", "folder", "link", "fifo", "of another run"])
def test_what_is_no_plain_file_of_this_run_is_refused(run: Path, name: str, change: str) -> None:
    path, away = run / name, run.parent / "away"
    os.rename(path, away)
    if change == "folder":
        path.mkdir()
    elif change == "link":
        path.symlink_to(away)
    elif change == "fifo":
        if not hasattr(os, "mkfifo"):
            pytest.skip("this system has no such files")
        os.mkfifo(path)
    elif change == "of another run":
        other = run_in(run.parents[1], "td-uniform") / name
        shutil.copy(other, path)
        if path.read_bytes() == away.read_bytes():  # both end at the same step
            return
    with pytest.raises((InnerattnError, OSError)) as caught:
        read_all(run)
    told = (path.name, "manifest.json", "holds no checkpoint")
    assert any(one in str(caught.value) for one in told)


@pytest.mark.parametrize("name", ["evaluation", "checkpoints", "checkpoints/96"])
def test_links_in_place_of_folders_are_refused(run: Path, name: str) -> None:
    away = run.parent / "away"
    os.rename(run / name, away)
    (run / name).symlink_to(away)
    with pytest.raises(RunError, match=r"plain|number|no checkpoint"):
        read_all(run)


def test_nothing_is_written_through_a_link(run: Path, tmp_path: Path) -> None:
    shutil.rmtree(run / "evaluation")
    (tmp_path / "elsewhere").mkdir()
    (run / "evaluation").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(RunError, match=r"evaluation: is a link; nothing is written through it"):
        Run(read_config(run), run, trained=True).do(lambda _: None)
    assert list((tmp_path / "elsewhere").iterdir()) == []


def test_the_run_folder_may_be_a_link(run: Path) -> None:
    link = run.with_name("link")
    link.symlink_to(run)
    read_all(link)


def test_a_run_without_a_manifest_is_read_with_a_warning(run: Path) -> None:
    (run / "manifest.json").unlink()
    with pytest.raises(RunError, match=r"manifest\.json: missing"):
        read_all(run)
    info = run / "run.json"
    info.write_text(info.read_text().replace('"sealed": true', '"sealed": false'))
    with pytest.warns(UnsealedRunWarning, match=r"has no manifest\.json; its files are read"):
        read_all(run)


def test_an_evaluation_takes_its_place_in_the_manifest_and_nothing_else(run: Path) -> None:
    summary = run / "evaluation" / "summary.json"
    summary.write_text(summary.read_text() + " ")
    config = run / "config.toml"
    whole = config.read_text()
    config.write_text(whole + "# another\n")
    amend(run, "evaluation")
    with pytest.raises(RunError, match=r"config\.toml: is not the file that manifest\.json names"):
        read_all(run)
    config.write_text(whole)
    read_all(run)


Change = Callable[[str], str]
FORGED: dict[str, tuple[str, Change, str]] = {
    "updates": ("run.json", lambda text: text.replace('"updates": ', '"updates": -'), "updates"),
    "env_steps": (
        "run.json",
        lambda text: text.replace('"env_steps": 96', '"env_steps": 1e400'),
        "",
    ),
    "state": ("run.json", lambda text: text.replace('"done"', '"sleeping"'), "sleeping"),
    "twice": ("run.json", lambda text: text.replace("{", '{"seed": 1,', 1), "run.json"),
    "digits": ("run.json", lambda text: text.replace('"seed": 0', '"seed": ' + 5000 * "1"), ""),
    "depth": ("run.json", lambda _: 100_000 * "[" + 100_000 * "]", "run.json"),
    "unknown": ("run.json", lambda text: text.replace("{", '{"wheels": 4,', 1), "wheels"),
    "mean": (
        "evaluation/summary.json",
        lambda text: text.replace('"mean": 0', '"mean": 999', 1),
        "summary.json",
    ),
    "not a number": (
        "evaluation/summary.json",
        lambda text: text.replace('"mean": 0', '"mean": NaN, "was": 0', 1),
        "summary.json",
    ),
}


@pytest.mark.filterwarnings("ignore::innerattn.errors.UnsealedRunWarning")
@pytest.mark.parametrize("what", FORGED)
def test_numbers_that_cannot_be_are_refused_though_nothing_is_sealed(run: Path, what: str) -> None:
    info = run / "run.json"
    info.write_text(info.read_text().replace('"sealed": true', '"sealed": false'))
    read_all(run)
    name, change, told = FORGED[what]
    text = (run / name).read_text()
    assert change(text) != text
    (run / name).write_text(change(text))
    with pytest.raises(RunError, match=told or "run.json"):
        read_all(run)


def test_weights_of_another_run_are_refused_though_they_are_sealed(run: Path) -> None:
    weights = "checkpoints/96/weights.safetensors"
    other = run_in(run.parents[1], "td-uniform")
    shutil.copy(other / weights, run / weights)
    reseal(run)
    with pytest.raises(RunError, match=r"weights\.safetensors: is not of this run"):
        load_policy(run)


def test_a_file_too_large_is_refused_before_it_is_read(run: Path) -> None:
    with (run / "run.json").open("r+b") as file:
        file.truncate(2**40)
    with pytest.raises(RunError, match=r"run\.json: has 1099511627776 bytes: must have at most"):
        RunFiles(run)
