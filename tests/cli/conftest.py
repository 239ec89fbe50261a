"""The command that tests of `innerattn reproduce` give."""

from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest
from small_study import Command

from innerattn.cli.main import main
from innerattn.report.targets import TARGETS


@pytest.fixture
def command(monkeypatch: pytest.MonkeyPatch, small: dict[str, object]) -> Command:
    """The command with small runs: target, folder, methods, then more options, in `mixed`."""

    def run(target: str, out: Path, methods: str, *options: str, **values: object) -> int:
        plan = partial(TARGETS[target].plan, overrides={**small, **values})
        monkeypatch.setitem(TARGETS, target, replace(TARGETS[target], plan=plan))
        given = ["--out", str(out), "--methods", methods, "--presets", "mixed"]
        return main(["reproduce", target, *given, *options])

    return run
