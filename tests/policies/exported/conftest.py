"""Two exported teams: one as plain as can be, one with everything."""

from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def plain_export(plain_team: Path) -> Path:
    """Flat networks of width 8, one for each robot; not to be changed."""
    return plain_team / "export"


@pytest.fixture(scope="session")
def framed_export(framed_team: Path) -> Path:
    """Entity networks in canonical frames, shared by kind; faults are seen; not to be changed."""
    return framed_team / "export"
