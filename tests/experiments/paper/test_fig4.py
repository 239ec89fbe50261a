"""Entropy during training against plain loops over the lines of metrics, and what is drawn."""

import csv
import io
import json
import math
from dataclasses import replace

import numpy as np
import pytest
from reseal import reseal

from innerattn.envs.colours import KIND_COLOURS
from innerattn.errors import RunError
from innerattn.experiments.paper.fig4 import PRINTED_NATS, EntropyCourse, fig4, fig4_json
from innerattn.experiments.run import FinishedRun
from innerattn.report.paper.fig4 import fig4_csv
from innerattn.report.plots.entropy import draw_entropy
from innerattn.stats.student import student_interval

FOOD, NAVIGATION, MEDICAL = KIND_COLOURS[:3]
TEAM_LOOKS = [(FOOD, "-"), (FOOD, "--"), (NAVIGATION, "-"), (MEDICAL, "-")]
"""Of food_0, food_1, navigation_0 and medical_0: a colour for each kind, a dash for a twin."""


@pytest.fixture(scope="module")
def courses(runs: list[FinishedRun]) -> list[EntropyCourse]:
    return fig4(runs)


def logged(run: FinishedRun) -> list[dict[str, dict[str, list[float]]]]:
    lines = (run.folder / "metrics.jsonl").read_text().splitlines()
    return [json.loads(line) for line in lines]


def test_means_and_bands_against_plain_loops(
    runs: list[FinishedRun], courses: list[EntropyCourse]
) -> None:
    course, tables = courses[0], [logged(run) for run in runs[:3]]
    mean, by_robot, by_head = course.mean(), course.by_robot(), course.end_by_head()
    for t in range(len(course.env_steps)):
        lines = [table[t]["attention_entropy"] for table in tables]
        assert [table[t]["env_steps"] for table in tables] == [course.env_steps[t]] * 3
        whole = [np.mean([sum(heads) / 2 for heads in line.values()]) for line in lines]
        interval = student_interval(whole)
        assert (mean.mean[t], mean.low[t], mean.high[t]) == pytest.approx(
            (interval.mean, interval.low, interval.high)
        )
        for r, robot in enumerate(("food_0", "food_1", "navigation_0", "medical_0")):
            own = np.array([line[robot] for line in lines])
            assert by_robot.mean[t, r] == pytest.approx(own.mean())
            if t == len(course.env_steps) - 1:  # a tenth of 12 lines is one
                assert by_head[:, r] == pytest.approx(own[[1, 2, 0]])  # seeds in order
    assert course.begin.mean == pytest.approx(mean.mean[0])
    assert course.end.mean == pytest.approx(mean.mean[-1])
    assert course.change.mean == pytest.approx(mean.mean[-1] - mean.mean[0])


def test_only_attention_that_chooses_is_drawn(courses: list[EntropyCourse]) -> None:
    found = [(course.method, course.seeds, course.chooses) for course in courses]
    assert found == [
        ("td-inner", (0, 1, 2), True),
        ("td-uniform", (0, 1), False),
        ("ppo-inner", (0,), True),
    ]


def test_the_figure_has_a_panel_for_each_situation_and_method(
    courses: list[EntropyCourse],
) -> None:
    lines = [course for course in courses if course.chooses]
    figure = draw_entropy(lines, PRINTED_NATS)
    drawn = [panel for panel in figure.axes if panel.axison]
    assert [panel.get_title() for panel in drawn] == [
        "mixed, td-inner\n3 runs, band: 95 %",
        "single, ppo-inner\n1 run",
    ]
    assert {panel.get_xlabel() for panel in drawn} == {"training [1,000 env-steps]"}
    assert [len(panel.collections) for panel in drawn] == [1, 0]  # a single run has no band
    for panel, line in zip(drawn, lines, strict=True):
        by_length: dict[int, list[np.ndarray]] = {}
        for one in panel.lines:
            by_length.setdefault(len(one.get_xdata()), []).append(np.asarray(one.get_ydata()))
        courses_drawn = by_length[len(line.env_steps)]
        assert np.array_equal(courses_drawn[-1], line.mean().mean)
        assert np.array_equal(courses_drawn[:-1], line.by_robot().mean.T)
        robots_drawn = [one for one in panel.lines if one.get_marker() == "None"][:4]
        looks = [(one.get_color(), one.get_linestyle()) for one in robots_drawn]
        assert looks == TEAM_LOOKS
        assert [one.get_color() for one in panel.lines if one.get_marker() == "o"] == [
            colour for colour, _ in TEAM_LOOKS
        ]
        runs, robots, heads = line.end_by_head().shape
        strips = [one for one in panel.lines if one.get_marker() == "o"]
        assert [len(one.get_ydata()) for one in strips] == [runs * heads] * robots
        last = line.env_steps[-1] / 1000.0
        assert all(min(one.get_xdata()) > last for one in strips)  # heads lie upon no course
        levels = [ends[0] for ends in by_length[2] if ends[0] == ends[1]]
        assert levels[-2:] == pytest.approx([math.log(3), PRINTED_NATS])
        assert max(panel.get_xticks()) <= 1.001 * last
        low, high = panel.get_ylim()
        assert low < min(line.end_by_head().min(), line.by_robot().mean.min())
        assert high > math.log(3)
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.texts] == [
        *("food_0", "food_1", "navigation_0", "medical_0", "mean over robots")
    ]


def test_csv_and_json_hold_the_same_numbers(courses: list[EntropyCourse]) -> None:
    lines = list(csv.DictReader(io.StringIO(fig4_csv(courses))))
    assert len(lines) == 3 * 12 * 5
    document = json.loads(json.dumps(fig4_json(courses), allow_nan=False))
    first = document["courses"][0]
    own = [x for x in lines if x["method"] == "td-inner" and x["robot"] == "all"]
    assert [float(line["mean_nats"]) for line in own] == first["mean"]["mean"]
    assert np.shape(first["nats_by_seed_time_robot_head"]) == (3, 12, 4, 2)
    single = [line for line in lines if line["method"] == "ppo-inner"]
    assert {(line["low"], line["band"]) for line in single} == {("", "none")}


def test_runs_logged_at_other_times_are_refused(runs: list[FinishedRun]) -> None:
    folder = runs[0].folder.with_name("other-times")
    folder.mkdir()
    (folder / "run.json").write_bytes((runs[0].folder / "run.json").read_bytes())
    text = (runs[0].folder / "metrics.jsonl").read_text().replace('00, "att', '50, "att')
    (folder / "metrics.jsonl").write_text(text)
    reseal(folder)
    with pytest.raises(RunError, match="never logged at the same env_steps"):
        fig4([runs[1], replace(runs[0], folder=folder)])
    with pytest.raises(RunError, match="not the metrics of a run"):
        fig4([replace(runs[0], folder=folder / "none")])
