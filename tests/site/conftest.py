"""The built site, once for all processes that test it."""

from pathlib import Path

import pytest
from built_site import build_site
from once import made_once


@pytest.fixture(scope="session")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder with the pages of the site; not to be changed."""
    return made_once(tmp_path_factory, "site", build_site) / "site"
