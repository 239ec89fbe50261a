"""A study of runs that take a second each."""

from pathlib import Path

import pytest
from tiny_study import TINY


@pytest.fixture
def tiny_file(tmp_path: Path) -> Path:
    file = tmp_path / "tiny.toml"
    file.write_text(TINY)
    return file
