"""The page on what faults cost: every number in its table, and no part that was not measured."""

import pytest
from made_faults import made_document
from markdown_rows import rows_of
from small_study import planned_of

from innerattn.config import Scenario
from innerattn.experiments.plan import METHODS
from innerattn.experiments.robustness.design import Group, groups
from innerattn.experiments.robustness.results import Measured, Robustness, over_groups
from innerattn.report.robustness import page
from innerattn.report.robustness.page import robustness_page
from innerattn.report.tables.text import plus_minus


def made(*parts: str) -> Robustness:
    """What made-up documents of two seeds say about parts of the study."""

    def document(group: Group, seed: int) -> dict[str, object]:
        name = group.cases[0].worlds if group.part == "teams" else "mixed"
        methods = [case.method for case in group.cases]
        return made_document(methods, Scenario.preset(name), group.kinds, seed)

    planned = planned_of("robustness", METHODS, ("mixed", "double"), 2)
    asked = [one for one in groups([one.case for one in planned]) if one.part in parts]
    found = [Measured(one, document(one, seed)) for seed, one in enumerate(asked)]
    return over_groups(found, ("motor_gain",))


@pytest.fixture(scope="module")
def whole() -> Robustness:
    return made("deployment", "training", "teams")


def section(text: str, heading: str) -> str:
    return text.split(f"\n## {heading}\n")[1].split("\n## ")[0]


@pytest.mark.long
@pytest.mark.parametrize("place", [0, 1])
def test_tables_of_a_situation(place: int, whole: Robustness) -> None:
    text = robustness_page(whole, "short", [])
    found = whole.deployments[place]
    rows = rows_of(section(text, f"{page.RETENTION}: {found.situation}"))
    names = [one.name for one in found.policies]
    assert rows[0] == ["retention", *names]
    assert rows[1][1:] == [plus_minus(one.retention["motor_gain"]) for one in found.policies]
    assert rows[10] == ["**all**", *(plus_minus(one.retention["all"]) for one in found.policies)]
    assert rows[11] == ["rescues", *names]
    with_fault = [plus_minus(one.rescues_with_fault["all"]) for one in found.policies]
    assert rows[13] == ["with a fault", *with_fault]
    assert rows[14] == ["inner − uniform", "td", "ppo"]
    assert rows[15][1:] == [plus_minus(x["motor_gain"]) for x in found.differences.values()]

    rows = rows_of(section(text, f"{page.RECOVERY}: {found.situation}"))
    oracle = found.policies[-1].after_onset["blackout"]
    (blackout,) = [row for row in rows if row[0] == "blackout"]
    assert rows[0][7:] == ["oracle, early", "oracle, late", "oracle, difference"]
    assert blackout[7:] == [plus_minus(x) for x in (oracle.early, oracle.late, oracle.change)]

    bounds = found.bounds
    assert bounds is not None
    shown = section(text, f"{page.BOUNDS}: {found.situation}")
    assert f"{bounds.violations} violations in {bounds.checks:,} checks of 4 critics" in shown
    level = bounds.levels[0]
    assert rows_of(shown)[1][:3] == [
        "observation, random, 0.1",
        f"{level.logit[0]:.3f}",
        f"{level.logit[1]:.2f}",
    ]
    rows = rows_of(section(text, f"{page.ATTENTION}: {found.situation}"))
    shift = found.attention["td-inner"]["motor_gain"]
    least, most = shift.by_robot
    by_robot = f"{least:+.2f} to {most:+.2f}"
    assert rows[1][:4] == [
        "motor gain",
        plus_minus(shift.effect),
        plus_minus(shift.auc),
        by_robot,
    ]


@pytest.mark.long
def test_training_and_teams() -> None:
    whole = made("training", "teams")
    text = robustness_page(whole, "short", ["faults of mixed-s9: not measured"])
    assert "- faults of mixed-s9: not measured\n" in text
    training = whole.training
    assert training is not None
    rows = rows_of(section(text, page.TRAINING))
    assert [row[0] for row in rows[1:3]] == ["motor gain (seen)", "speed limit (unseen)"]
    parts = [*(one.retention["all"] for one in training.policies), training.gain["all"]]
    assert rows[-2][1:5] == [plus_minus(x) for x in parts]
    assert rows[-1][0] == "rescues without a fault"
    rows = rows_of(section(text, page.TEAMS))
    assert len(rows) == 1 + 15
    assert rows[1][0] == "mixed-1-food (3 robots, 1 food), td-inner"
    assert rows[1][2] == f"{whole.teams[0].retention['food']:.2f}"


def test_what_is_not_measured_has_no_section() -> None:
    text = robustness_page(made("teams"), "short", [])
    assert f"\n## {page.TEAMS}\n" in text
    assert text.count("\n## ") == 1
    assert "\n## " not in robustness_page(made(), "short", [])
