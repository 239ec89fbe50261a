"""An interruption ends training even if something has swallowed it."""

from __future__ import annotations

import json
import signal
import threading
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest

from innerattn.config import load_run_config
from innerattn.signals import Interrupted, exit_code
from innerattn.train import Progress, train
from innerattn.train.interruption import remembered_interruptions


@pytest.fixture(autouse=True)
def interrupting() -> Iterator[None]:
    """SIGINT interrupts, whatever this process was begun with."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def swallowed() -> None:
    with suppress(KeyboardInterrupt):
        signal.raise_signal(signal.SIGINT)


def test_what_was_swallowed_is_raised_when_asked_for() -> None:
    with remembered_interruptions() as interruptions:
        interruptions.check()
        swallowed()
        for _ in range(2):
            with pytest.raises(KeyboardInterrupt):
                interruptions.check()
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_one_waits_for_a_good_moment_and_a_second_one_does_not() -> None:
    with remembered_interruptions() as interruptions:
        with interruptions.deferred():
            signal.raise_signal(signal.SIGINT)
            assert not interruptions.urgent
            with pytest.raises(KeyboardInterrupt):
                interruptions.check()
            with pytest.raises(KeyboardInterrupt), interruptions.at_once():
                pytest.fail("an interruption that was asked for comes first")
            with pytest.raises(Interrupted) as caught:
                signal.raise_signal(signal.SIGINT)
        assert interruptions.urgent
        assert exit_code(caught.value) == 130
    with remembered_interruptions() as interruptions, interruptions.deferred():
        with pytest.raises(KeyboardInterrupt), interruptions.at_once():
            signal.raise_signal(signal.SIGINT)
        assert not interruptions.urgent


def test_other_handlers_and_threads_stay_as_they_are() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with remembered_interruptions() as interruptions:
        assert signal.getsignal(signal.SIGINT) == signal.SIG_IGN
        signal.raise_signal(signal.SIGINT)
        interruptions.check()
    assert signal.getsignal(signal.SIGINT) == signal.SIG_IGN

    signal.signal(signal.SIGINT, signal.default_int_handler)
    seen = []

    def elsewhere() -> None:
        with remembered_interruptions():
            seen.append(signal.getsignal(signal.SIGINT))

    thread = threading.Thread(target=elsewhere)
    thread.start()
    thread.join()
    assert seen == [signal.default_int_handler]


def test_training_ends_where_an_interruption_was_swallowed(
    small: dict[str, object], tmp_path: Path
) -> None:
    steps = []

    def progress(now: Progress) -> None:
        steps.append(now.env_steps)
        if len(steps) == 3:
            swallowed()

    config = load_run_config("mixed", "td-inner", "quick", overrides=small)
    with pytest.raises(KeyboardInterrupt):
        train(config, tmp_path / "run", progress=progress)
    assert len(steps) == 3
    assert json.loads((tmp_path / "run" / "run.json").read_text())["state"] == "interrupted"
    assert list((tmp_path / "run" / "checkpoints").iterdir())
