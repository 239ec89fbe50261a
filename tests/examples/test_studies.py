"""The example studies are planned, and ask something."""

from pathlib import Path

import pytest

from innerattn.studies.plan import plan_study
from innerattn.studies.study import study_in

FOLDER = Path(__file__).parents[2] / "examples" / "studies"


@pytest.mark.parametrize("file", sorted(FOLDER.glob("*.toml")), ids=lambda file: file.stem)
def test_it_is_planned_and_asks_something(file: Path) -> None:
    study = study_in(file.read_bytes(), file)
    assert study.question
    assert study.contrasts or study.search or study.tables
    assert plan_study(study, FOLDER.joinpath)
