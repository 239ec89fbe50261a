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

from innerattn.study.crossed.arms import plan_crossed  # noqa: E402
from innerattn.study.inventory import FinishedRun  # noqa: E402
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


@pytest.fixture(scope="session")
def crossed_study(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[FinishedRun]]:
    """Runs of all arms in mixed, two of each, in a study's folder."""
    out = tmp_path_factory.mktemp("crossed")
    found = []
    planned = plan_crossed(("td-inner", "td-uniform"), ("mixed",), range(2), "quick", out)
    for number, one in enumerate(planned):  # no two runs alike
        case = one.case
        made = made_run(out / "made", "mixed", case.method, case.seed, chance=number)
        one.folder.parent.mkdir(exist_ok=True)
        made.folder.rename(one.folder)
        found.append(FinishedRun(one.case, one.folder))
    return out, found
