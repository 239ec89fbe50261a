"""Entropy during training against plain loops over the lines of metrics, and what is drawn."""

import csv
import io
import json
import math
from dataclasses import replace

import numpy as np
import pytest

from innerattn.errors import RunError
from innerattn.experiments.paper.fig4 import PRINTED_NATS, EntropyCourse, fig4, fig4_json
from innerattn.experiments.run import FinishedRun
from innerattn.report.paper.fig4 import fig4_csv, fig4_lines
from innerattn.report.plots.entropy import draw_entropy
from innerattn.stats.student import student_interval


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
    mean, by_robot, by_head = course.mean(), course.by_robot(), course.by_head()
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
            assert by_head[t, r] == pytest.approx(own.mean(0))
    assert course.begin.mean == pytest.approx(mean.mean[0])  # a tenth of 12 lines is one
    assert course.end.mean == pytest.approx(mean.mean[-1])
    assert course.change.mean == pytest.approx(mean.mean[-1] - mean.mean[0])


def test_only_attention_that_chooses_is_drawn(courses: list[EntropyCourse]) -> None:
    found = [(course.method, course.seeds, course.chooses) for course in courses]
    assert found == [
        ("td-inner", (0, 1, 2), True),
        ("td-uniform", (0, 1), False),
        ("ppo-inner", (0,), True),
    ]
    lines = fig4_lines(courses)
    assert [line.label for line in lines] == ["td-inner (3 runs, 95 %)", "ppo-inner (1 run)"]


def test_the_figure_has_a_column_for_each_situation(courses: list[EntropyCourse]) -> None:
    figure = draw_entropy(fig4_lines(courses), PRINTED_NATS)
    shown = [panel for panel in figure.axes if panel.axison]
    assert [panel.get_title() for panel in figure.axes if not panel.axison] == ["", ""]
    upper = shown[:2]
    assert [panel.get_title() for panel in shown[2:]] == [
        "td-inner by robot; thin: its heads",
        "ppo-inner by robot; thin: its heads",
    ]
    assert [panel.get_title() for panel in upper] == ["mixed", "single"]
    assert figure.axes[0].get_ylabel() == "entropy of attention [nats]"
    assert {panel.get_xlabel() for panel in shown} == {"training [1,000 env-steps]"}
    for panel in shown:
        levels = [line.get_ydata()[0] for line in panel.lines if len(line.get_ydata()) == 2]
        assert levels == pytest.approx([math.log(3), PRINTED_NATS])
        (right,) = panel.child_axes
        assert right.get_ylabel() in ("", "exp(entropy) [teammates]")
    assert [len(panel.collections) for panel in shown] == [1, 0, 4, 0]  # a single run has no band
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.texts] == [
        *("food_0", "food_1", "navigation_0", "medical_0")
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
    text = (runs[0].folder / "metrics.jsonl").read_text().replace('00, "att', '50, "att')
    (folder / "metrics.jsonl").write_text(text)
    with pytest.raises(RunError, match="never logged at the same env_steps"):
        fig4([runs[1], replace(runs[0], folder=folder)])
    with pytest.raises(RunError, match="not the metrics of a run"):
        fig4([replace(runs[0], folder=folder / "none")])
