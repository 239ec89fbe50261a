"""Two exported teams: one as plain as can be, one with everything."""

from pathlib import Path

import pytest
from made_export import FRAMED, made_export
from once import made_once


@pytest.fixture(scope="session")
def plain_export(plain_team: Path) -> Path:
    """Flat networks of width 8, one for each robot; not to be changed."""
    return plain_team / "export"


@pytest.fixture(scope="session")
def framed_export(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Entity networks in canonical frames, shared by kind; faults are seen; not to be changed."""
    values = {**FRAMED, "scenario.observe_faults": True, "scenario.victim_order": "slot"}

    def make(folder: Path) -> None:
        made_export(folder, "ppo-inner", **values)

    return made_once(tmp_path_factory, "framed_export", make) / "export"
