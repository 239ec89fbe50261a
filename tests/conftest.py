"""Finished runs for tests of more than one room: trained by the command itself, or made up."""

from __future__ import annotations

import os
import shutil
import signal
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from hypothesis import HealthCheck, settings

sys.path.insert(0, str(Path(__file__).parent / "support"))

from once import made_once

from innerattn.cores import let_waiting_threads_sleep

# The process that hands out the tests reads this file, too, and does not wait for PyTorch:
# fixtures import what they need.
if TYPE_CHECKING:
    from innerattn.experiments.plan import Case
    from innerattn.experiments.run import FinishedRun

let_waiting_threads_sleep()  # as the command does

# A slow machine fails no property.
settings.register_profile(
    "untimed",
    deadline=None,
    max_examples=int(os.environ.get("INNERATTN_EXAMPLES", "25")),
    suppress_health_check=[HealthCheck.too_slow],
)
settings.load_profile("untimed")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Give tests that take minutes an hour; the others have the limit of pyproject.toml."""
    for item in items:
        if item.get_closest_marker("slow") and not item.get_closest_marker("timeout"):
            item.add_marker(pytest.mark.timeout(3_600))


@pytest.fixture(autouse=True, scope="session")
def one_thread() -> None:
    """There is a process of the tests for each core."""
    import torch

    torch.set_num_threads(1)


@pytest.fixture(autouse=True)
def same_draws() -> None:
    """Each test's draws from torch's own generator are the same in every run and any order."""
    import torch

    torch.manual_seed(0)


@pytest.fixture(scope="session")
def tiny() -> list[str]:
    """Options of `train` for a run of a few seconds."""
    options = {
        "train.env-steps": 400,
        "train.num-envs": 8,
        "train.threads": 1,
        "train.log-every-env-steps": 100,
        "td.warmup-env-steps": 64,
        "td.batch-size": 32,
        "network.hidden-width": 16,
        "network.attention-heads": 2,
        "evaluate.episodes": 4,
        "evaluate.score-episodes": 6,
        "evaluate.long-episodes": 2,
        "evaluate.long-episode-steps": 30,
    }
    return [word for key, value in options.items() for word in (f"--{key}", str(value))]


@pytest.fixture(scope="session")
def run_dir(tmp_path_factory: pytest.TempPathFactory, tiny: list[str]) -> Path:
    """A run's folder; not to be changed."""

    from innerattn.cli.main import main

    def make(folder: Path) -> None:
        assert main(["train", "--run-dir", str(folder / "tiny"), "--seed", "3", *tiny]) == 0

    return made_once(tmp_path_factory, "run_dir", make) / "tiny"


@pytest.fixture(scope="session")
def plain_team(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of a run by td-inner, ``run``, and of its export, ``export``; not to be changed."""
    from made_export import made_export  # PyTorch takes long to load what exports

    return made_once(tmp_path_factory, "plain_team", lambda folder: made_export(folder, "td-inner"))


@pytest.fixture(scope="session")
def framed_team(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """As ``plain_team``, of PPO in canonical frames, shared by kind, that sees faults."""
    from made_export import FRAMED, made_export

    values = {**FRAMED, "scenario.observe_faults": True, "scenario.victim_order": "slot"}

    def make(folder: Path) -> None:
        made_export(folder, "ppo-inner", **values)

    return made_once(tmp_path_factory, "framed_team", make)


@pytest.fixture(scope="session")
def any_team(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of ``zoo:any``, exported for five robots: ``export``; not to be changed."""
    from team_of_any import exported  # PyTorch takes long to load what exports

    return made_once(tmp_path_factory, "any_team", exported)


@pytest.fixture(scope="session")
def small() -> dict[str, object]:
    """Values by key for runs of a second."""
    return {
        "train.env_steps": 96,
        "train.num_envs": 8,
        "td.warmup_env_steps": 48,
        "td.batch_size": 16,
        "td.update_every_env_steps": 24,
        "ppo.rollout_steps": 6,
        "ppo.minibatch_size": 16,
        "network.hidden_width": 8,
        "network.attention_heads": 2,
        "evaluate.episodes": 2,
        "evaluate.score_episodes": 3,
        "evaluate.long_episodes": 2,
        "evaluate.long_episode_steps": 5,
    }


@pytest.fixture
def in_this_process(monkeypatch: pytest.MonkeyPatch) -> None:
    """Trains the runs of a study one after the other, in this process."""
    from in_turn import do_in_turn

    monkeypatch.setattr("innerattn.studies.launch.local.run_side_by_side", do_in_turn)


@pytest.fixture(scope="session")
def finished_study(tmp_path_factory: pytest.TempPathFactory, small: dict[str, object]) -> Path:
    """Folder of two finished runs, td-inner and td-uniform, seed 0; not to be changed."""
    from small_study import begin_small

    from innerattn.studies.work import work

    def make(folder: Path) -> None:
        study = begin_small("paper", folder, ("td-inner", "td-uniform"), 1, small)
        work(study.ledger(), study.to_do)
        shutil.rmtree(study.path)

    return made_once(tmp_path_factory, "finished_study", make)


@pytest.fixture
def study(tmp_path: Path, finished_study: Path) -> Path:
    """A copy of the finished study, to be changed at will."""
    return Path(shutil.copytree(finished_study, tmp_path / "study"))


@pytest.fixture(scope="session")
def runs(tmp_path_factory: pytest.TempPathFactory) -> list[FinishedRun]:
    """Three runs with and two without inner attention, and one of another situation."""
    from made_run import made_run

    from innerattn.experiments.plan import Case
    from innerattn.experiments.run import read_run

    cases = [
        *(Case("mixed", "td-inner", seed) for seed in (2, 0, 1)),
        *(Case("mixed", "td-uniform", seed) for seed in (0, 1)),
        Case("single", "ppo-inner", 0),
    ]

    def make(folder: Path) -> None:
        for case in cases:
            made_run(folder, case.worlds, case.method, case.seed)

    folder = made_once(tmp_path_factory, "made_runs", make)
    return [read_run(case, folder / f"{case.worlds}-{case.method}-s{case.seed}") for case in cases]


@pytest.fixture(scope="session")
def crossed_study(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[FinishedRun]]:
    """Runs of all arms in mixed, two of each, in a study's folder; not to be changed."""
    from made_run import made_run

    from innerattn.experiments.crossed.arms import ARMS
    from innerattn.experiments.plan import Case
    from innerattn.experiments.run import read_run

    cases = [Case("mixed", arm.method, seed, arm.variant) for seed in range(2) for arm in ARMS]

    def folder_of(out: Path, case: Case) -> Path:
        return out / "runs" / f"mixed-{case.method}-{case.variant}-quick-s{case.seed}"

    def make(out: Path) -> None:
        (out / "runs").mkdir()
        for number, case in enumerate(cases):  # no two runs alike
            made = made_run(out / "made", "mixed", case.method, case.seed, chance=number)
            made.folder.rename(folder_of(out, case))

    out = made_once(tmp_path_factory, "crossed_study", make)
    return out, [read_run(case, folder_of(out, case)) for case in cases]


@pytest.fixture(scope="module")
def crossed(
    crossed_study: tuple[Path, list[FinishedRun]], tmp_path_factory: pytest.TempPathFactory
) -> tuple[Path, list[FinishedRun]]:
    """A copy of the study of all arms, into which files may be written."""
    shared, runs = crossed_study
    out = shutil.copytree(shared, tmp_path_factory.mktemp("crossed") / "study")
    return out, [replace(run, folder=out / run.folder.relative_to(shared)) for run in runs]


@pytest.fixture
def interruptible() -> Iterator[None]:
    """Ctrl-C interrupts this process and those it begins; the end of a terminal ends the latter.

    Tests may have been begun by a shell's ``&`` or by ``nohup``, and processes inherit what these
    ignore.
    """
    hangup = signal.signal(signal.SIGHUP, signal.SIG_DFL)
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)
    signal.signal(signal.SIGHUP, hangup)
