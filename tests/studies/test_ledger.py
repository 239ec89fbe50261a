"""Claims of runs: who gets them, who loses them, and what is left when workers are killed."""

import errno
import json
import os
import random
import signal
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from innerattn.studies.ledger import MOST_DEATHS, MOST_FAILURES, Claim, ClaimLostError, Ledger
from innerattn.studies.owner import is_gone, this_process

KEYS = [f"run-{number}" for number in range(4)]
SILENT = 60.0


class Clock:
    """Seconds of one worker."""

    def __init__(self, now: float = 0.0) -> None:
        self.now = now

    def __call__(self) -> float:
        return self.now


def claimed(ledger: Ledger, *keys: str) -> Claim:
    claim = ledger.claim(keys or KEYS)
    assert claim is not None
    claim.folder.mkdir(exist_ok=True)  # the worker makes it
    return claim


def test_a_run_from_plan_to_end(tmp_path: Path) -> None:
    ledger = Ledger(tmp_path / "study")
    assert set(ledger.states(KEYS).values()) == {"planned"}
    claim = claimed(ledger)
    assert (claim.key, claim.number) == ("run-0", 1)
    assert list(claim.folder.iterdir()) == []
    assert ledger.states(KEYS)["run-0"] == "claimed"
    (claim.folder / "result").write_text("found")
    done = claim.finish()
    assert done == tmp_path / "study/runs/run-0"
    assert (done / "result").read_text() == "found"
    assert ledger.states(KEYS)["run-0"] == "done"
    assert claimed(ledger).key == "run-1"
    assert claimed(Ledger(tmp_path / "study")).key == "run-2"


def test_a_silent_claim_is_taken_over_by_the_watchers_own_clock(tmp_path: Path) -> None:
    own = Ledger(tmp_path, clock=Clock(), silent_after_s=SILENT)
    clock = Clock(1e6)  # what the clocks say of each other counts for nothing
    other = Ledger(tmp_path, clock=clock, silent_after_s=SILENT)
    slow = claimed(own, "run-0")
    (slow.folder / "checkpoint").write_text("7")
    (slow.folder / "metrics.jsonl").write_text("1\n")
    assert other.claim(["run-0"]) is None  # watched from now on
    clock.now += SILENT - 1
    assert other.claim(["run-0"]) is None
    slow.beat()
    clock.now += 2
    assert other.claim(["run-0"]) is None  # it has changed
    clock.now += SILENT
    taken = claimed(other, "run-0")
    assert taken.number == 2
    assert (taken.folder / "checkpoint").read_text() == "7"
    with pytest.raises(ClaimLostError, match="taken the run over"):
        slow.beat()
    with (slow.folder / "metrics.jsonl").open("a") as file:  # it has not noticed yet
        file.write("2\n")
    (slow.folder / "checkpoint").unlink()
    assert (taken.folder / "metrics.jsonl").read_text() == "1\n"
    assert (taken.folder / "checkpoint").read_text() == "7"
    taken.finish()
    assert [path.name for path in (tmp_path / "work").iterdir()] == []
    with pytest.raises(ClaimLostError, match="taken the run over"):
        slow.beat()


def test_of_two_that_finish_the_first_one_wins(tmp_path: Path) -> None:
    clock = Clock()
    ledger = Ledger(tmp_path, clock=clock, silent_after_s=SILENT)
    slow = claimed(ledger, "run-0")
    assert ledger.claim(["run-0"]) is None
    clock.now += SILENT
    second = claimed(ledger, "run-0")
    (slow.folder / "by").write_text("slow")
    (second.folder / "by").write_text("second")
    slow.finish()
    with pytest.raises(ClaimLostError, match="finished it"):
        second.beat()
    with pytest.raises(ClaimLostError, match="finished it"):
        second.finish()
    assert (tmp_path / "runs/run-0/by").read_text() == "slow"
    assert ledger.claim(["run-0"]) is None


def test_what_is_given_back_goes_on_at_once(tmp_path: Path) -> None:
    ledger = Ledger(tmp_path)
    claim = claimed(ledger, "run-0")
    (claim.folder / "checkpoints").mkdir()
    (claim.folder / "checkpoints/latest").write_text("5")
    claim.free()
    assert ledger.states(["run-0"]) == {"run-0": "planned"}
    again = claimed(ledger, "run-0")
    assert (again.number, (again.folder / "checkpoints/latest").read_text()) == (2, "5")


def test_a_run_that_fails_is_tried_three_times(tmp_path: Path) -> None:
    ledger = Ledger(tmp_path)
    for attempt in range(MOST_FAILURES):
        assert ledger.states(["run-0"])["run-0"] == "planned"
        claimed(ledger, "run-0").fail(f"diverged {attempt} \udce9")
    assert ledger.claim(["run-0"]) is None
    assert ledger.states(["run-0"]) == {"run-0": "failed"}
    assert ledger.failures("run-0") == [rf"diverged {n} \udce9" for n in range(MOST_FAILURES)]
    assert claimed(ledger).key == "run-1"  # it stops no other


def test_a_run_that_ends_its_workers_is_given_up(tmp_path: Path) -> None:
    clock = Clock(0.0)
    ledger = Ledger(tmp_path, clock=clock, silent_after_s=SILENT)
    for death in range(MOST_DEATHS):
        claim = claimed(ledger, "run-0")
        assert claim.number == death + 1
        assert ledger.claim(["run-0"]) is None  # it is watched from now on
        clock.now += SILENT
    assert ledger.claim(["run-0"]) is None
    assert ledger.states(["run-0"]) == {"run-0": "failed"}
    assert len(ledger.failures("run-0")) == MOST_DEATHS
    assert "ended without a word" in ledger.failures("run-0")[-1]


def test_workers_that_save_something_are_no_sign_of_a_bad_run(tmp_path: Path) -> None:
    clock = Clock(0.0)
    ledger = Ledger(tmp_path, clock=clock, silent_after_s=SILENT)
    for step in range(2 * MOST_DEATHS):
        claim = claimed(ledger, "run-0")
        (claim.folder / "checkpoints").mkdir(parents=True, exist_ok=True)
        (claim.folder / "checkpoints/latest").unlink(missing_ok=True)  # a link to the earlier one
        (claim.folder / "checkpoints/latest").write_text(f"{step}\n")
        assert ledger.claim(["run-0"]) is None
        clock.now += SILENT
    assert ledger.states(["run-0"]) == {"run-0": "claimed"}
    assert ledger.failures("run-0") == []


@pytest.mark.parametrize("key", ["", "../a", "a.1", "a/b", "a b", "x" * 129])
def test_other_names_are_refused(key: str, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="must be letters, digits, '-' and '_'"):
        Ledger(tmp_path).claim([key])


@pytest.mark.parametrize("number", [errno.EPERM, errno.EOPNOTSUPP, errno.ENOSYS, errno.EINVAL])
def test_without_hard_links(number: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(*_: object, **__: object) -> None:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(os, "link", refused)
    ledger = Ledger(tmp_path)
    claim = claimed(ledger, "run-0")
    (claim.folder / "checkpoint").write_text("7")
    assert ledger.claim(["run-0"]) is None
    claim.free()
    assert (claimed(ledger, "run-0").folder / "checkpoint").read_text() == "7"


def test_a_link_whose_answer_was_lost_counts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    link = os.link

    def asked_again(source: Path, target: Path) -> None:
        link(source, target)
        raise FileExistsError(17, "File exists")

    monkeypatch.setattr(os, "link", asked_again)
    assert claimed(Ledger(tmp_path), "run-0").number == 1


def test_a_process_that_is_gone_is_seen_at_once(tmp_path: Path) -> None:
    words = "import sys; from pathlib import Path; from innerattn.studies.ledger import Ledger; "
    words += "Ledger(Path(sys.argv[1])).claim(['run-0']); print(flush=True); sys.stdin.read()"
    with subprocess.Popen(
        [sys.executable, "-c", words, str(tmp_path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as worker:
        assert worker.stdout is not None
        worker.stdout.readline()
        ledger = Ledger(tmp_path)
        assert ledger.claim(["run-0"]) is None
        worker.kill()
    assert claimed(ledger, "run-0").number == 2


def test_other_owners_are_not_taken_for_gone() -> None:
    own = this_process()
    for owner in ("", "x", "boot pid:[1] 1 1", f"{own} more", own.replace("pid", "pip"), own):
        assert not is_gone(owner)


ACTIONS = st.sampled_from(["claim", "beat", "finish", "fail", "free", "wait", "die"])


@settings(max_examples=60)
@given(actions=st.lists(st.tuples(st.integers(0, 2), ACTIONS), max_size=60))
def test_any_order_of_events(
    actions: list[tuple[int, str]], tmp_path_factory: pytest.TempPathFactory
) -> None:
    folder = tmp_path_factory.mktemp("ledger")
    clocks = [Clock(1e5 * number) for number in range(3)]
    ledgers = [Ledger(folder, clock=clock, silent_after_s=SILENT) for clock in clocks]
    held: list[Claim | None] = [None] * 3
    finished: Counter[str] = Counter()
    for worker, action in actions:
        claim = held[worker]
        if action == "wait":
            clocks[worker].now += SILENT
        elif action == "claim" and claim is None:
            held[worker] = ledgers[worker].claim(KEYS)
        elif claim is not None:
            held[worker] = None
            try:
                if action == "beat":
                    claim.beat()
                    held[worker] = claim
                elif action == "finish":
                    claim.folder.mkdir(exist_ok=True)
                    assert claim.finish().is_dir()
                    finished[claim.key] += 1
                elif action == "fail":
                    claim.fail("why")
                elif action == "free":
                    claim.free()
            except ClaimLostError:
                pass
        numbers = [(one.key, one.number) for one in held if one is not None]
        assert len(set(numbers)) == len(numbers)
    assert set(finished.values()) <= {1}
    states = ledgers[0].states(KEYS)
    assert {key for key, state in states.items() if state == "done"} == set(finished)
    for _ in range(3 * MOST_FAILURES + 9):  # whatever happened, another worker ends the study
        claim = ledgers[1].claim(KEYS)
        clocks[1].now += SILENT
        if claim is not None:
            claim.folder.mkdir(exist_ok=True)
            claim.finish()
    assert set(ledgers[2].states(KEYS).values()) <= {"done", "failed"}


WORKER = """
import json, os, sys, time
from pathlib import Path
from innerattn.studies.ledger import ClaimLostError, Ledger

folder, runs, steps = Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3])
keys = [f"run-{number}" for number in range(runs)]
ledger = Ledger(folder)
while set(ledger.states(keys).values()) != {"done"}:
    claim = ledger.claim(keys)
    if claim is None:
        time.sleep(0.02)
        continue
    claim.folder.mkdir(exist_ok=True)
    try:
        while True:
            path = claim.folder / "checkpoints" / "latest"
            path.parent.mkdir(exist_ok=True)
            done = json.loads(path.read_text()) if path.exists() else []
            if len(done) == steps:
                claim.finish()
                break
            partial = path.with_name("partial")
            partial.write_text(json.dumps([*done, len(done)]))
            os.replace(partial, path)
            claim.beat()
            time.sleep(0.005)
    except ClaimLostError:
        pass
"""


@pytest.mark.long
def test_workers_that_are_killed_lose_and_repeat_nothing(tmp_path: Path) -> None:
    runs, steps, rng = 16, 60, random.Random(0)
    words = [sys.executable, "-c", WORKER, str(tmp_path), str(runs), str(steps)]
    workers = [subprocess.Popen(words) for _ in range(3)]
    keys = [f"run-{number}" for number in range(runs)]
    ledger, killed = Ledger(tmp_path), 0
    try:
        while set(ledger.states(keys).values()) != {"done"}:
            time.sleep(rng.uniform(0.05, 0.3))
            index = rng.randrange(len(workers))
            if killed < 10 and any((tmp_path / "work").iterdir()):
                workers[index].send_signal(signal.SIGKILL)
                workers[index].wait()
                killed += 1
            if workers[index].poll() is not None:
                workers[index] = subprocess.Popen(words)
    finally:
        for worker in workers:
            worker.kill()
            worker.wait()
    assert killed > 3
    for key in keys:
        assert json.loads((tmp_path / "runs" / key / "checkpoints/latest").read_text()) == list(
            range(steps)
        )
    assert sorted(os.listdir(tmp_path / "runs")) == sorted(keys)
