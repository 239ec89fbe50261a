"""Two exported teams: one as plain as can be, one with everything."""

from pathlib import Path

import pytest
from made_export import FRAMED, made_export


@pytest.fixture(scope="session")
def plain_export(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Flat networks of width 8, one for each robot; not to be changed."""
    return made_export(tmp_path_factory.mktemp("plain"), "td-inner")[1]


@pytest.fixture(scope="session")
def framed_export(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Entity networks in canonical frames, shared by kind; faults are seen; not to be changed."""
    values = {**FRAMED, "scenario.observe_faults": True, "scenario.victim_order": "slot"}
    return made_export(tmp_path_factory.mktemp("framed"), "ppo-inner", **values)[1]
