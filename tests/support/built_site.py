"""The site, built once for all tests that look at it."""

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]


def build_site(folder: Path) -> Path:
    """Build the site as `make site` does: a warning is an error.

    Returns:
        The folder with its pages.
    """
    options = ["--quiet", "--fail-on-warning", "--keep-going", "-c", "docs"]
    command = [sys.executable, "-m", "sphinx", *options, "-d", str(folder / "doctrees"), "."]
    done = subprocess.run(
        [*command, str(folder / "site")], cwd=ROOT, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    return folder / "site"
