"""The command that tests of `innerattn reproduce` give."""

from pathlib import Path

import pytest
from small_study import Command, with_values

from innerattn.cli.main import main
from innerattn.studies import shipped


@pytest.fixture
def command(monkeypatch: pytest.MonkeyPatch, small: dict[str, object]) -> Command:
    """The command with small runs: target, folder, methods, then more options, in `mixed`."""
    narrowed = shipped.narrowed

    def run(target: str, out: Path, methods: str, *options: str, **values: object) -> int:
        given = {**small, **values}
        monkeypatch.setattr(
            shipped, "narrowed", lambda *a, **b: with_values(narrowed(*a, **b), given)
        )
        chosen = ["--out", str(out), "--methods", methods, "--presets", "mixed"]
        return main(["reproduce", target, *chosen, *options])

    return run
