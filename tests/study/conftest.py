import sys
from pathlib import Path

import pytest

HERE = Path(__file__).parent
# Made runs, and the fresh ones they begin as.
sys.path[:0] = [
    str(HERE),
    str(HERE.parent / "evaluate"),
]

from made_run import made_run  # noqa: E402

from innerattn.study.run import StudyRun  # noqa: E402


@pytest.fixture(scope="session")
def runs(tmp_path_factory: pytest.TempPathFactory) -> list[StudyRun]:
    """Three runs with and two without inner attention, and one of another situation."""
    folder = tmp_path_factory.mktemp("runs")
    return [
        *(made_run(folder, "mixed", "td-inner", seed) for seed in (2, 0, 1)),
        *(made_run(folder, "mixed", "td-uniform", seed) for seed in (0, 1)),
        made_run(folder, "single", "ppo-inner", 0),
    ]
