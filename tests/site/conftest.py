"""The built site, once for each process that tests it."""

from pathlib import Path

import pytest
from built_site import build_site


@pytest.fixture(scope="session")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder with the pages of the site; not to be changed."""
    return build_site(tmp_path_factory.mktemp("site"))
