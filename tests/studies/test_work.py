"""Workers: what they do with the runs of a study, alone, together, and when they are stopped."""

import hashlib
import json
import threading
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import pytest

from innerattn.errors import RunError
from innerattn.experiments.side_by_side import Run
from innerattn.studies import work as working
from innerattn.studies.folder import StudyFolder, begin_study, open_study
from innerattn.studies.ledger import Claim, ClaimLostError
from innerattn.studies.work import Outcome, work


def weights(study: StudyFolder) -> dict[str, str]:
    """Digest of the last weights of each run, by its name."""
    return {
        run.key: json.loads((study.runs / run.key / "run.json").read_text())["weights_sha256"]
        for run in study.planned
    }


def test_one_worker_does_all(tiny_file: Path, tmp_path: Path) -> None:
    study = begin_study(tiny_file, tmp_path / "one")
    outcomes: list[Outcome] = []
    work(study.ledger(), study.planned, ended=outcomes.append)
    assert [one.run for one in outcomes] == study.planned
    assert {one.state for one in outcomes} == {"done"}
    assert len(set(weights(study).values())) == 6
    for run in study.planned:
        assert (study.runs / run.key / "evaluation/summary.json").exists()
    again: list[Outcome] = []
    work(study.ledger(), study.planned, ended=again.append)
    assert again == []


@pytest.mark.long
def test_stopped_and_gone_on_with_it_gives_the_same(
    tiny_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole, cut = (begin_study(tiny_file, tmp_path / name) for name in ("whole", "cut"))
    work(whole.ledger(), whole.planned)
    do, reports = Run.do, 0

    def stopped(self: Run, report: Callable[[float], None]) -> object:
        def now_and_then(share: float) -> None:
            nonlocal reports
            reports += 1
            if reports in (3, 9):
                raise KeyboardInterrupt
            report(share)

        return do(self, now_and_then)

    monkeypatch.setattr(Run, "do", stopped)
    for _ in range(2):
        with pytest.raises(KeyboardInterrupt):
            work(cut.ledger(), cut.planned)
    assert any((cut.path / "work").iterdir())  # what was saved
    work(cut.ledger(), cut.planned)
    assert weights(cut) == weights(whole)
    assert list((cut.path / "work").iterdir()) == []


def test_time_is_up(tiny_file: Path, tmp_path: Path) -> None:
    study = begin_study(tiny_file, tmp_path / "study")
    ticks, outcomes = iter(range(1_000)), list[Outcome]()
    work(
        study.ledger(),
        study.planned,
        until=4.0,
        ended=outcomes.append,
        clock=lambda: float(next(ticks)),
    )
    assert [one.state for one in outcomes] == ["given back"]
    assert set(study.ledger().states(run.key for run in study.planned).values()) == {"planned"}


def test_a_run_that_fails_stops_no_other(
    tiny_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    study = begin_study(tiny_file, tmp_path / "study")
    do = Run.do

    def failing(self: Run, report: Callable[[float], None]) -> object:
        if self.config.train.seed == 1:
            raise RunError("no luck")
        if self.config.train.seed == 2:
            raise IndexError("a fault of ours")
        return do(self, report)

    monkeypatch.setattr(Run, "do", failing)
    outcomes: list[Outcome] = []
    work(study.ledger(), study.planned, ended=outcomes.append)
    assert Counter(one.state for one in outcomes) == {"done": 2, "failed": 4 * 3}
    states = study.ledger().states(run.key for run in study.planned)
    assert Counter(states.values()) == {"done": 2, "failed": 4}
    reasons = [study.ledger().failures(run.key)[-1] for run in study.planned if run.seed]
    assert reasons[0] == "no luck"
    assert "Traceback" in reasons[-1]
    assert reasons[-1].endswith("IndexError: a fault of ours\n")


def test_a_claim_that_is_lost_ends_the_run(
    tiny_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    study = begin_study(tiny_file, tmp_path / "study")
    lost = threading.Event()

    def beat(_: Claim) -> None:
        if lost.is_set():
            raise ClaimLostError("another worker has it")

    do = Run.do

    def slow(self: Run, report: Callable[[float], None]) -> object:
        lost.set()
        for thread in threading.enumerate():
            if thread.name == "beat":
                thread.join()
        return do(self, report)

    monkeypatch.setattr(Claim, "beat", beat)
    monkeypatch.setattr(Run, "do", slow)
    monkeypatch.setattr(working, "BEAT_EVERY_S", 0.001)
    outcomes: list[Outcome] = []

    def ended(one: Outcome) -> None:
        outcomes.append(one)
        raise StopIteration

    with pytest.raises(StopIteration):
        work(study.ledger(), study.planned, ended=ended)
    assert [one.state for one in outcomes] == ["lost"]
    assert list(study.runs.iterdir()) == []


@pytest.mark.long
def test_two_workers_share_the_runs(tiny_file: Path, tmp_path: Path) -> None:
    alone, shared = (begin_study(tiny_file, tmp_path / name) for name in ("alone", "shared"))
    work(alone.ledger(), alone.planned)
    first, second = shared.ledger(), shared.ledger()
    outcomes: list[Outcome] = []

    def in_turn(one: Outcome) -> None:
        outcomes.append(one)
        claim = second.claim(run.key for run in shared.planned)
        if claim is not None:  # held to the end, then given back
            held.append(claim)

    held: list[Claim] = []
    work(first, shared.planned, wait=False, ended=in_turn)
    assert len(outcomes) + len(held) == 6
    assert {one.run.key for one in outcomes}.isdisjoint(claim.key for claim in held)
    for claim in held:
        claim.free()
    work(second, shared.planned)
    assert weights(shared) == weights(alone)
    digests = {
        hashlib.sha256((study.runs / run.key / "evaluation/summary.json").read_bytes()).hexdigest()
        for study in (alone, shared)
        for run in study.planned
    }
    assert len(digests) == 6


@pytest.mark.long
def test_studies_share_the_runs_of_a_pool(tiny_file: Path, tmp_path: Path) -> None:
    pool = tmp_path / "pool"
    first = begin_study(tiny_file, tmp_path / "first", pool=pool)
    work(first.ledger(), first.to_do)
    tiny_file.write_text(tiny_file.read_text().replace('"0..2"', "[0, 5]"))
    second = begin_study(tiny_file, tmp_path / "second", pool=pool)
    states = {run.key: second.states()[run.key] for run in second.planned}
    assert list(states.values()) == ["done", "done", "planned", "planned"]
    assert second.rules[0].finished == 2
    assert open_study(second.path).runs == pool / "runs"
    with pytest.raises(RunError, match=r"its runs are in .*pool: must be .*other; choose another"):
        begin_study(tiny_file, tmp_path / "second", pool=tmp_path / "other")
    (second.path / "pool.json").write_text('{"folder": "../elsewhere"}')
    with pytest.raises(RunError, match=r"names .*elsewhere, which holds no runs of a study"):
        open_study(second.path)
    assert not (tmp_path / "elsewhere").exists()
    (second.path / "pool.json").write_text("{}")
    with pytest.raises(RunError, match=r"pool\.json: does not name the folder"):
        open_study(second.path)
