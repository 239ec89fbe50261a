"""Handoffs of many runs: the control, means over runs by plain loops, the rule, the figures."""

import json
from dataclasses import replace

import numpy as np
import pytest

from innerattn.envs.colours import robot_looks
from innerattn.experiments.paper.claims import handoff_claims
from innerattn.experiments.paper.fig5 import Evidence, evidence, evidence_json
from innerattn.experiments.paper.scene import choose_scene, scene_json
from innerattn.experiments.run import FinishedRun
from innerattn.measures.sharing.handoff import (
    HANDOFF,
    all_handoffs,
    handoffs,
    need_following_attention,
    with_control,
)
from innerattn.measures.sharing.handoff_attention import handoff_attention
from innerattn.report.paper.fig5 import shift_sentence
from innerattn.report.plots.aligned import draw_aligned
from innerattn.report.plots.handoff import draw_handoff
from innerattn.stats import Estimate


@pytest.fixture(scope="module")
def inner(runs: list[FinishedRun]) -> list[FinishedRun]:
    return [runs[index] for index in (1, 2, 0)]


@pytest.fixture(scope="module")
def found(inner: list[FinishedRun]) -> Evidence:
    found = evidence(inner)
    assert found is not None
    return found


def counted(measured: FinishedRun) -> list[np.void]:
    """Handoffs at which the other food robot rescues nobody, in a plain loop."""
    record, rows = measured.recorded, []
    for row in all_handoffs(record):
        low, high = max(row["start"], row["first"] - 7), min(row["second"], row["first"] + 8)
        own = record.rescues[record.rescues["episode"] == row["episode"]]
        other = own[(own["helper_0"] == 1 - row["robot"]) | (own["helper_1"] == 1 - row["robot"])]
        if not any(low <= step <= high for step in other["step"]):
            rows.append(row)
    return rows


def changes(measured: FinishedRun, role: str, *, bystander: bool) -> list[float]:
    """Mean weight after the first rescue minus that up to it, of each handoff."""
    weights, values = measured.recorded.steps["attention"], []
    for row in counted(measured):
        robot = 1 - row["robot"] if bystander else row["robot"]
        own = weights[row["episode"], :, :, robot, row[role]].astype(float).mean(1)
        lowest = max(row["start"], row["first"] - 7)
        before = own[lowest : row["first"] + 1]
        after = own[row["first"] + 1 : min(row["second"], row["first"] + 8) + 1]
        values.append(after.mean() - before.mean())
    return values


def test_changes_of_robot_and_control_against_plain_loops(
    inner: list[FinishedRun], found: Evidence
) -> None:
    for parts, bystander in ((found.robot, False), (found.control, True)):
        for role, name in (("to_be", "after"), ("before", "before")):
            plain = [np.mean(changes(measured, name, bystander=bystander)) for measured in inner]
            assert parts[role].change_by_run == pytest.approx(plain)
            assert parts[role].change is not None
            assert parts[role].change.mean == pytest.approx(np.mean(plain))
    own = np.subtract(found.robot["to_be"].change_by_run, found.control["to_be"].change_by_run)
    assert found.own_part_by_run == pytest.approx(own)
    assert found.handoffs == tuple(len(counted(m)) for m in inner)
    assert found.left_out == tuple(
        len(all_handoffs(m.recorded)) - n for m, n in zip(inner, found.handoffs, strict=True)
    )
    assert min(found.handoffs) > 0
    assert min(found.left_out) > 0
    beyond = own - np.divide(found.robot["to_be"].change_by_run, 2.0)
    assert found.own_part_beyond_half is not None
    assert found.own_part_beyond_half.mean == pytest.approx(beyond.mean())
    for measured, own_p, control_p in zip(
        inner, found.p_by_run, found.control_p_by_run, strict=True
    ):
        record = measured.recorded
        own = np.array(counted(measured), HANDOFF)
        for p, of in ((own_p, own), (control_p, with_control(record, own))):
            attention = handoff_attention(record, of, 0)
            assert attention is not None
            assert p == attention.p
    assert found.p_by_run != found.control_p_by_run


def test_the_ceiling_is_one_where_the_control_rescues_nobody(
    inner: list[FinishedRun], found: Evidence
) -> None:
    assert found.ceiling is not None
    assert found.ceiling.mean == pytest.approx(1.0)
    follows = []
    for measured in inner:
        record = measured.recorded
        made = replace(record, steps={"attention": need_following_attention(record)})
        follows.append(replace(measured, read=lambda made=made: [made]))
    perfect = evidence(follows)
    assert perfect is not None
    assert perfect.own_part_by_run == pytest.approx([1.0] * 3)
    assert perfect.control["to_be"].change_by_run == pytest.approx([0.0] * 3)
    # With the control's own rescues the measure is not that of who hands over.
    for measured in follows:
        record, every = measured.recorded, all_handoffs(measured.recorded)
        control = handoff_attention(record, with_control(record, every), 0)
        assert control is not None
        assert abs(control.to_be.change[0, 0]) > 0.01


def test_a_run_without_handoffs_does_not_count(inner: list[FinishedRun]) -> None:
    record = inner[2].recorded
    without = replace(inner[2], read=lambda: [replace(record, rescues=record.rescues[:0])])
    found, of_two = evidence([*inner[:2], without]), evidence(inner[:2])
    assert found is not None
    assert of_two is not None
    assert (found.seeds, found.runs, found.handoffs[2]) == ((0, 1, 2), 2, 0)
    assert found.own_part_by_run == (*of_two.own_part_by_run, None)
    assert found.p_by_run[2] is found.control_p_by_run[2] is None
    assert found.ceiling == of_two.ceiling
    assert found.own_part == of_two.own_part
    ((panel,), (expected,)) = (draw_aligned([one]).axes for one in (found, of_two))
    assert panel.get_title() == expected.get_title()
    assert panel.get_title().startswith("mixed, td-inner\n2 runs, band: least to largest, ")
    for one, other in zip(panel.lines, expected.lines, strict=True):
        assert np.array_equal(one.get_ydata(), other.get_ydata())
    assert {claim.runs for claim in handoff_claims([found])} == {2}


def test_the_control_takes_no_part(inner: list[FinishedRun]) -> None:
    record = inner[0].recorded
    own = all_handoffs(record)
    control = with_control(record, own)
    assert set(own["robot"]) == {0, 1}
    assert (control["robot"] == 1 - own["robot"]).all()
    for name in ("episode", "before", "after", "start", "first", "second"):
        assert (control[name] == own[name]).all()


def test_even_attention_gives_no_evidence(runs: list[FinishedRun]) -> None:
    assert evidence(runs[3:5]) is None


def test_the_scene_follows_its_rule(inner: list[FinishedRun]) -> None:
    scene, record = choose_scene(inner), inner[0].recorded
    assert scene is not None
    best = max(
        handoffs(record, "food_0", "task_1", "task_2").tolist(),
        key=lambda h: (min(h[5] - h[4] + 1, h[6] - h[5]), h[6] - h[4], -h[0]),
    )
    assert (scene.robot, scene.before, scene.after) == (0, 3, 2)
    assert (scene.start, scene.first, scene.second) == best[4:]
    assert scene.title == f"mixed, td-inner, seed 0, episode {best[0]}"
    assert (scene.positions == record.steps["positions"][best[0]]).all()
    document = json.loads(json.dumps(scene_json(scene), allow_nan=False))
    assert len(document["steps"]) == len(document["weights_by_step_head_robot"])


def test_the_scene_is_drawn_as_panels_a_b_and_c(inner: list[FinishedRun]) -> None:
    scene = choose_scene(inner)
    assert scene is not None
    figure = draw_handoff(scene)
    arenas, overall, heads = figure.axes[:3], figure.axes[3], figure.axes[4:]
    assert {(panel.get_xlabel(), panel.get_ylabel()) for panel in arenas} == {("x [m]", "y [m]")}
    names = {robot.name for robot in scene.scenario.robots}
    assert all(names <= {text.get_text() for text in panel.texts} for panel in arenas)
    assert overall.get_xlabel() == "step of the episode [0.1 s each]"
    lines = [line for line in overall.lines if line.get_label().startswith("on ")]
    looks = robot_looks(robot.kind for robot in scene.scenario.robots)
    assert [line.get_color() for line in lines] == [look.colour for look in looks[1:]]
    assert [line.get_linestyle() for line in lines] == ["--", "-", "-"]  # food_1 is food_0's twin
    assert [one.get_color() for one in arenas[0].lines[0:8:2]] == [look.colour for look in looks]
    shown = np.array([line.get_ydata() for line in lines])
    steps = slice(scene.start, scene.second + 1)
    assert shown == pytest.approx(scene.weights[steps].mean(1)[:, 1:].T)
    assert [panel.get_title() for panel in heads] == ["head 1", "head 2"]
    assert [panel.get_title(loc="left") for panel in figure.axes] == [*"A", "", "", *"BC", ""]


def test_all_handoffs_are_drawn_with_their_control(found: Evidence) -> None:
    (panel,) = draw_aligned([found]).axes
    runs = f"3 runs, band: 95 %, {sum(found.handoffs)} handoffs"
    assert panel.get_title() == f"mixed, td-inner\n{runs}"
    assert panel.get_xlabel() == "steps since the first rescue [0.1 s]"
    assert panel.get_ylabel() == "weight, mean over heads"
    drawn = [line.get_ydata() for line in panel.lines[:4]]
    courses = [parts[role].weight.mean for parts in (found.robot, found.control) for role in parts]
    assert np.array(drawn) == pytest.approx(np.array(courses))
    assert len(panel.collections) == 4
    assert json.dumps(evidence_json([found]), allow_nan=False)


def shifted(found: Evidence, robot: float, control: float, own: Estimate) -> Evidence:
    """The same evidence with other changes of the weight on the next partner."""
    parts = [
        {**of, "to_be": replace(of["to_be"], change=Estimate(change))}
        for of, change in ((found.robot, robot), (found.control, control))
    ]
    return replace(found, robot=parts[0], control=parts[1], own_part=own)


def test_one_sentence_tells_what_part_of_the_shift_singles_out_the_partner(
    found: Evidence,
) -> None:
    rises = "After the first rescue the weight on the next partner rises by 0.28"
    cases = [
        (0.28, 0.21, Estimate(0.07, 0.02, 0.12), f"{rises}, a bystander's weight on it by 0.21: "
         "75 % of the shift is the bystander's too, and 25 % (0.07 [0.02, 0.12]) singles out the "
         "partner."),
        (0.28, 0.21, Estimate(0.07, -0.02, 0.16), "25 % (0.07 [-0.02, 0.16]), whose interval "
         "includes 0, singles out the partner."),
        (0.28, -0.05, Estimate(0.33), f"{rises}, a bystander's weight on it does not (-0.05): the "
         "whole shift singles out the partner."),
        (0.28, 0.3, Estimate(-0.02), "by 0.30: nothing singles out the partner."),
        (-0.04, 0.3, Estimate(-0.34), "does not rise (-0.04), so nothing singles it out."),
    ]  # fmt: skip
    for robot, control, own, words in cases:
        assert words in shift_sentence(shifted(found, robot, control, own))
    assert found.robot["to_be"].change is not None
    assert f"{found.robot['to_be'].change.mean:.2f}" in shift_sentence(found)
    assert "No handoff" in shift_sentence(replace(found, own_part=None))
