import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))  # the tests' workers in threads

from worker_threads import Together, run_together


@pytest.fixture
def together() -> Together:
    return run_together
