"""Loggers follow the progress of a training, and whatever happens to them, it goes on."""

import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from innerattn.config import load_run_config
from innerattn.errors import InnerattnError, MissingLibraryError
from innerattn.loggers import LOGGERS, Opened, RunLoggers, open_logger
from innerattn.loggers.logger import values_of


@dataclass
class Fake:
    fails: bool = False
    got: list[Any] = field(default_factory=list)

    def log(self, env_steps: int, values: Mapping[str, float]) -> None:
        if self.fails:
            raise ConnectionError("no route\nto host")
        self.got.append((env_steps, dict(values)))

    def close(self, ending: str) -> None:
        self.got.append(ending)


@pytest.fixture
def opened() -> Opened:
    return Opened(Path("runs/a-run"), load_run_config("mixed", "ppo-inner", "quick"))


def use(fakes: Mapping[str, Fake], monkeypatch: pytest.MonkeyPatch) -> None:
    module = SimpleNamespace(**{name: lambda _, fake=fake: fake for name, fake in fakes.items()})
    monkeypatch.setitem(sys.modules, "fakes", module)
    table = {name: (f"fakes:{name}", "fakes") for name in fakes}
    monkeypatch.setattr("innerattn.loggers.logger.LOGGERS", table)


def reported(env_steps: int, **metrics: Any) -> Any:
    return SimpleNamespace(metrics={"env_steps": env_steps, **metrics})


def test_every_line_is_sent_once(opened: Opened, monkeypatch: pytest.MonkeyPatch) -> None:
    fakes = {"a": Fake(), "b": Fake()}
    use(fakes, monkeypatch)
    with RunLoggers(["a", "b", "a"], opened) as loggers:
        loggers(SimpleNamespace(metrics=None))
        first = reported(100, losses={"critic": 2.0}, rescues_per_episode=None)
        loggers(first)
        loggers(first)
        loggers(reported(200, losses={}, rescues_per_episode=1.5))
    for fake in fakes.values():
        assert fake.got == [
            (100, {"losses/critic": 2.0}),
            (200, {"rescues_per_episode": 1.5}),
            "done",
        ]


def test_a_logger_that_fails_is_left_out_and_said_once(
    opened: Opened, monkeypatch: pytest.MonkeyPatch
) -> None:
    fakes = {"bad": Fake(fails=True), "good": Fake()}
    use(fakes, monkeypatch)
    said: list[str] = []
    with RunLoggers(["bad", "good"], opened, failed=said.append) as loggers:
        for step in (1, 2, 3):
            loggers(reported(step, x=0.5))
    assert said == ["bad: no route to host"]
    assert fakes["good"].got == [(1, {"x": 0.5}), (2, {"x": 0.5}), (3, {"x": 0.5}), "done"]
    assert fakes["bad"].got == []


@pytest.mark.parametrize(
    ("error", "ending"), [(KeyboardInterrupt, "interrupted"), (ValueError, "failed")]
)
def test_loggers_learn_how_a_run_ended(
    error: type[BaseException], ending: str, opened: Opened, monkeypatch: pytest.MonkeyPatch
) -> None:
    fakes = {"a": Fake()}
    use(fakes, monkeypatch)
    with pytest.raises(error), RunLoggers(["a"], opened):
        raise error
    assert fakes["a"].got == [ending]


def test_what_cannot_begin_is_said_before_training(
    opened: Opened, monkeypatch: pytest.MonkeyPatch
) -> None:
    fakes = {"a": Fake()}
    use(fakes, monkeypatch)

    def refuse(_: Opened) -> None:
        raise PermissionError("log in first")

    sys.modules["fakes"].refuse = refuse  # type: ignore[attr-defined]
    table = {"a": ("fakes:a", "fakes"), "refuse": ("fakes:refuse", "fakes")}
    monkeypatch.setattr("innerattn.loggers.logger.LOGGERS", table)
    with pytest.raises(InnerattnError, match=r"^--log refuse: log in first$"):
        RunLoggers(["a", "refuse"], opened)
    assert fakes["a"].got == ["failed"]


@pytest.mark.parametrize("name", LOGGERS)
def test_a_missing_library_is_named(
    name: str, opened: Opened, monkeypatch: pytest.MonkeyPatch
) -> None:
    package = LOGGERS[name][1]
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(MissingLibraryError) as caught:
        open_logger(name, opened)
    assert str(caught.value) == f"--log {name} needs {package}: pip install 'innerattn[log]'"


numbers = st.floats(allow_nan=False)
lines = st.recursive(
    numbers | st.none() | st.lists(numbers, max_size=3),
    lambda inner: st.dictionaries(st.text("abc", min_size=1), inner, max_size=3),
)


@given(st.dictionaries(st.text("abc", min_size=1), lines, max_size=4))
def test_names_lead_back_to_the_numbers(line: dict[str, Any]) -> None:
    values = values_of(line)
    for name, value in values.items():
        found: Any = line
        for part in name.split("/"):
            found = found[int(part)] if isinstance(found, list) else found[part]
        assert found == value
    assert len(values) == count(line)


def count(value: Any) -> int:
    if isinstance(value, dict):
        return sum(map(count, value.values()))
    if isinstance(value, list):
        return len(value)
    return 0 if value is None else 1
