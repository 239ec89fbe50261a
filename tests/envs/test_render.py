"""The picture of a world shows what is in it, where it is."""

from typing import Any

import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import Arc, Wedge
from numpy.typing import NDArray

from innerattn.config import Obstacle, Scenario
from innerattn.envs import parallel_env
from innerattn.envs.render import draw_world, paint_figure
from innerattn.envs.victims import victim_dtype

VICTIM = np.dtype([("present", "i1"), ("task", "i1"), ("x", "f4"), ("y", "f4")])
PLACES = np.array([[-0.7, -0.7], [0.7, -0.7], [-0.7, 0.7], [0.7, 0.7]], np.float32)


def picture(
    scenario: Scenario, places: NDArray[np.float32] = PLACES, present: int = 1
) -> NDArray[np.uint8]:
    victims = np.array([(present, 0, 0.0, 0.0)], VICTIM)
    obstacles = np.zeros((len(scenario.obstacles), 2), np.float32)
    return draw_world(scenario, places, np.zeros_like(places), victims, obstacles)


def count(image: NDArray[np.uint8], colour: str) -> int:
    return int((image == np.round(np.array(to_rgb(colour)) * 255)).all(-1).sum())


def test_picture_is_pixels() -> None:
    image = picture(Scenario())
    assert image.shape == (600, 800, 3)
    assert image.dtype == np.uint8
    assert image.min() < 50
    assert image.max() == 255


def test_victims_and_obstacles_appear() -> None:
    plain, empty = picture(Scenario()), picture(Scenario(), present=0)
    assert count(plain, "#D55E00") > count(empty, "#D55E00") + 50
    blocks = Scenario(
        obstacles=(Obstacle(shape="box", half_extents_m=(0.2, 0.2), position_m=(0.0, 0.0)),)
    )
    disc = Scenario(obstacles=(Obstacle(shape="disc", radius_m=0.2, position_m=(0.0, 0.0)),))
    box_area, disc_area = (
        count(picture(blocks, present=0), "#999999"),
        count(picture(disc, present=0), "#999999"),
    )
    assert count(plain, "#999999") < 50
    assert disc_area / box_area == pytest.approx(np.pi / 4, rel=0.05)


def test_robots_are_where_they_are() -> None:
    left, right = PLACES.copy(), PLACES.copy()
    left[:, 0], right[:, 0] = -0.8, 0.8
    difference = (picture(Scenario(), left) != picture(Scenario(), right)).any(-1)
    columns = np.flatnonzero(difference.any(0))
    assert columns.max() - columns.min() > 250
    middle = (columns.max() + columns.min()) // 2
    assert not difference[:, middle - 40 : middle + 40].any()


def test_the_legend_names_every_mark() -> None:
    figure, scenario = Figure(), Scenario()
    victims = np.zeros(0, VICTIM)
    paint_figure(figure, scenario, PLACES, np.ones_like(PLACES), victims, np.zeros((0, 2), "f4"))
    (legend,) = figure.legends
    names = [text.get_text().split(":")[0] for text in legend.texts]
    tasks = [task.name for task in scenario.tasks]
    assert names == [*tasks, "rescue radius", "food", "navigation", "medical", "velocity"]


def test_render_through_the_environment() -> None:
    env = parallel_env(render_mode="rgb_array")
    with pytest.raises(ResetNeeded, match="reset"):
        env.render()
    env.reset(seed=0)
    before = env.render()
    env.step({"food_0": 1, "food_1": 2, "navigation_0": 3, "medical_0": 4})
    after = env.render()
    assert before is not None
    assert after is not None
    assert (before != after).any()
    silent = parallel_env()
    silent.reset(seed=0)
    assert silent.render() is None


def test_robots_on_wheels_have_a_nose() -> None:
    def noses(scenario: Scenario, angles: NDArray[np.float32] | None) -> tuple[list[Any], str]:
        figure = Figure()
        still, victims = np.zeros_like(PLACES), np.array([(1, 0, 0.0, 0.0)], VICTIM)
        paint_figure(figure, scenario, PLACES, still, victims, np.zeros((0, 2), "f4"), angles)
        found = [one.get_xydata() for one in figure.axes[0].lines if one.get_linewidth() == 3]
        return found, " ".join(text.get_text() for text in figure.legends[0].get_texts())

    preset = Scenario.preset("mixed-wheels")
    angles = np.array([0.0, np.pi / 2, 0.0, 0.0], np.float32)
    found, legend = noses(preset, angles)
    np.testing.assert_allclose(found[0], [PLACES[0], PLACES[0] + [0.075, 0.0]], atol=1e-6)
    np.testing.assert_allclose(found[1], [PLACES[1], PLACES[1] + [0.0, 0.075]], atol=1e-6)
    assert len(found) == 2
    assert "heading" in legend
    for scenario, given in ((preset, None), (Scenario(), angles)):
        found, legend = noses(scenario, given)
        assert not found
        assert "heading" not in legend


def test_sight_is_drawn_as_far_and_as_wide_as_it_is() -> None:
    plain = Scenario.preset("mixed-wheels")
    first, second, third, last = plain.robots
    robots = (
        first.replace(sight_m=0.5, field_of_view_deg=90.0),
        second,
        third.replace(sight_m=0.3),
        last,
    )
    figure, victims = Figure(), np.array([(1, 0, 0.0, 0.0)], VICTIM)
    angles = np.array([np.pi / 2, 0.0, 0.0, 0.0], np.float32)
    rest = np.zeros_like(PLACES), victims, np.zeros((0, 2), np.float32), angles
    paint_figure(figure, plain.replace(robots=robots), PLACES, *rest)
    fan, circle = (one for one in figure.axes[0].patches if isinstance(one, Wedge))
    assert (fan.center, fan.r) == (pytest.approx(PLACES[0]), 0.5)
    assert (fan.theta1, fan.theta2) == (pytest.approx(45.0), pytest.approx(135.0))
    assert (circle.center, circle.r) == (pytest.approx(PLACES[2]), 0.3)
    assert circle.theta2 - circle.theta1 == 360.0
    assert "sight" in [text.get_text() for text in figure.legends[0].get_texts()]
    assert len({one.get_facecolor()[:3] for one in (fan, circle)}) == 2
    paint_figure(figure := Figure(), plain, PLACES, *rest)
    assert not [one for one in figure.axes[0].patches if isinstance(one, Wedge)]


def test_services_and_deadlines_are_drawn() -> None:
    scenario = Scenario(
        tasks=[one.replace(service_s=2.0, deadline_s=9.0) for one in Scenario().tasks]
    )
    victims = np.zeros(3, victim_dtype(scenario))
    victims["present"] = True, True, False
    victims["x"], victims["y"] = (0.25, 0.5, 0.0), (-0.5, 0.5, 0.0)
    victims["served"], victims["deadline_step"] = (0.25, 0.0, 0.5), (37, -1, 37)
    world = PLACES, np.zeros_like(PLACES), victims, np.zeros((0, 2), np.float32)
    for step, said in ((12, ["2.5 s"]), (12.25, ["2.5 s"]), (40, ["0.0 s"]), (None, [])):
        figure = Figure()
        paint_figure(figure, scenario, *world, step=step)
        (axes,) = figure.axes
        (arc,) = (one for one in axes.patches if isinstance(one, Arc))
        assert (arc.center, arc.theta1, arc.theta2) == ((0.25, -0.5), 0.0, 90.0)
        texts = {one.get_text(): one.xy for one in axes.texts if one.get_text().endswith(" s")}
        assert texts == dict.fromkeys(said, (0.25, -0.5))
        names = [text.get_text() for text in figure.legends[0].get_texts()]
        assert "share of\nservice done" in names
        assert ("time until\nit is lost" in names) == (step is not None)


def test_worlds_without_them_name_neither() -> None:
    figure, victims = Figure(), np.array([(1, 0, 0.0, 0.0)], VICTIM)
    still, none = np.zeros_like(PLACES), np.zeros((0, 2), np.float32)
    paint_figure(figure, Scenario(), PLACES, still, victims, none, step=3)
    names = " ".join(text.get_text() for text in figure.legends[0].get_texts())
    assert "service" not in names
    assert "lost" not in names


def test_the_environment_says_how_long_victims_wait() -> None:
    tasks = [one.replace(deadline_s=5.0) for one in Scenario().tasks]
    pictures = []
    for scenario in (Scenario(), Scenario(tasks=tasks)):
        env = parallel_env(scenario, render_mode="rgb_array")
        env.reset(seed=0)
        for _ in range(2):
            env.step(dict.fromkeys(env.agents, 0))
            pictures.append(env.render()[60:540, 80:580].astype(int))
    inside = [int((one != pictures[0]).any(-1).sum()) for one in pictures]
    assert inside[1] == 0
    assert 20 < inside[2] != inside[3] > 20


def test_layers_are_told_apart_with_a_legend() -> None:
    def shown(scenario: Scenario) -> tuple[list[str], list[object]]:
        figure = Figure()
        still, victims = np.zeros_like(PLACES), np.array([(1, 0, 0.0, 0.0)], VICTIM)
        obstacles = np.zeros((len(scenario.obstacles), 2), np.float32)
        paint_figure(figure, scenario, PLACES, still, victims, obstacles)
        labels = [text.get_text() for text in figure.legends[0].get_texts()]
        robots = [one for one in figure.axes[0].patches if one.get_zorder() == 3]
        return labels, [one.get_linestyle() for one in robots]

    labels, edges = shown(Scenario.preset("air-ground"))
    assert "outline of\nlayer air" in labels
    assert edges == ["--", "--", "-", "-"]
    labels, edges = shown(Scenario())
    assert not any("layer" in label for label in labels)
    assert len(set(edges)) == 1


@pytest.mark.parametrize(
    ("above", "side"), [((-0.7, 0.7), "bottom"), ((0.02, 0.13), "top"), ((0.02, -0.13), "bottom")]
)
def test_a_name_covers_no_other_robot(above: tuple[float, float], side: str) -> None:
    places = PLACES.copy()
    places[0], places[1] = (0.0, 0.0), above
    figure = Figure(figsize=(8, 6))
    victims = np.zeros(1, VICTIM)
    none = np.zeros((0, 2), np.float32)
    paint_figure(figure, Scenario(), places, np.zeros_like(places), victims, none)
    (axes,) = figure.axes
    (name,) = [text for text in axes.texts if text.get_text() == "food_0"]
    assert name.get_va() == side
    box = name.get_window_extent()
    centre = axes.transData.transform(above)
    beyond = np.maximum(np.abs(centre - [(box.x0 + box.x1) / 2, (box.y0 + box.y1) / 2]), 0.0)
    beyond = np.maximum(beyond - [box.width / 2, box.height / 2], 0.0)
    radius = axes.transData.transform((0.05, 0.0))[0] - axes.transData.transform((0.0, 0.0))[0]
    assert np.hypot(*beyond) >= radius
