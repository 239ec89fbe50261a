"""Range sensors as Python sees them: columns, bounds, words, networks, and what is refused."""

from typing import Any

import numpy as np
import pytest
import torch

from innerattn.config import RangeSensor, RunConfig, Scenario
from innerattn.config.refusals import refuse_stores_drives_and_senses
from innerattn.envs import BatchEnv, parallel_env
from innerattn.envs.bounds import observation_bounds
from innerattn.errors import ConfigError
from innerattn.nn.symmetry import NUM_ELEMENTS, SquareSymmetry
from innerattn.report.scenario_words import scenario_words
from innerattn.train.build import build_learner
from innerattn.train.frames import square_symmetry, turning_columns

ENVS = 4
FAN = RangeSensor(rays=5, range_m=0.7, field_of_view_deg=90.0)


def sensing(*sensors: RangeSensor | None, **values: Any) -> Scenario:
    """The usual team with these sensors, one for each robot or one for all."""
    scenario = Scenario()
    each = sensors * 4 if len(sensors) == 1 else sensors
    drive = "unicycle" if FAN in each else "force"
    robots = tuple(
        robot.replace(range_sensor=sensor, drive=drive)
        for robot, sensor in zip(scenario.robots, each, strict=True)
    )
    return scenario.replace(robots=robots, **values)


def test_rays_follow_a_robots_own_columns_and_stay_within_bounds() -> None:
    scenario = sensing(FAN, RangeSensor(rays=2, range_m=3.0), None, FAN)
    low, high = observation_bounds(scenario)
    with BatchEnv(scenario, ENVS, seed=3, num_threads=1) as env:
        names = env.observation_names()
        rng, rows = np.random.default_rng(0), [env.reset()]
        for _ in range(60):
            rows.append(env.step(rng.integers(0, 5, (ENVS, 4))).obs)
    rays = [column for column, name in enumerate(names) if name.startswith("own.ray.")]
    assert [names[column] for column in rays] == [f"own.ray.{ray}" for ray in range(5)]
    assert names[rays[0] - 1] == "own.turn_rate"
    assert names[rays[-1] + 1].startswith("teammate_0.")
    found = np.stack(rows)
    assert ((low <= found) & (found <= high)).all()
    assert (low[rays] == 0).all()
    assert (high[rays] == 1).all()
    values = found[..., rays]
    assert (values[:, :, 2] == 0).all()  # it has no sensor
    assert (values[:, :, 1, 2:] == 0).all()  # it has two rays
    assert (values[:, :, 1, :2] > 0).all()  # a wall is nearer than 3 m on all sides
    assert (values[:, :, [0, 3]] == 0).any()
    assert (values[:, :, [0, 3]] > 0).any()
    view = parallel_env(scenario)
    seen, _ = view.reset(seed=1)
    for robot, row in seen.items():
        assert view.observation_space(robot).contains(row)


def test_info_says_who_measures_what() -> None:
    words = scenario_words(sensing(FAN, RangeSensor(rays=1, range_m=2.0), None, FAN))
    assert "food_0, medical_0: 5 rays over 90 degrees measure how far things are, up to 0.7 m" in (
        words
    )
    assert "food_1: 1 ray measure how far things are, up to 2 m" not in words
    assert "food_1: 1 ray measures how far things are, up to 2 m" in words
    upward = RangeSensor(rays=8, range_m=0.5, layers=("ground",))
    assert "8 rays measure how far things in ground are, up to 0.5 m" in scenario_words(
        sensing(upward)
    )
    assert "ray" not in scenario_words(Scenario())


@pytest.mark.parametrize("encoder", ["flat", "entities"])
def test_networks_take_rays(encoder: str) -> None:
    scenario = sensing(RangeSensor(rays=8, range_m=0.5))
    config = RunConfig.model_validate(
        {"scenario": scenario, "network": {"encoder": encoder, "symmetry": "none"}}
    )
    with BatchEnv(scenario, ENVS, num_threads=1) as env:
        build_learner(config, env)


def turned_by_hand(values: np.ndarray, element: int, wheels: bool) -> np.ndarray:
    """Readings of rays in a world whose x, then y, is mirrored, and whose axes then change."""
    angles = 2 * np.pi * np.arange(values.shape[-1]) / values.shape[-1]
    directions = np.stack([np.cos(angles), np.sin(angles)], -1)
    if wheels:  # a mirror changes left and right of a robot
        directions = directions * [1, -1 if element.bit_count() % 2 else 1]
    else:
        directions = directions * [-1 if element & 1 else 1, -1 if element & 2 else 1]
        directions = directions[:, ::-1] if element & 4 else directions
    new = np.arctan2(directions[:, 1], directions[:, 0]) * values.shape[-1] / (2 * np.pi)
    found = np.empty_like(values)
    found[..., np.rint(new).astype(int) % values.shape[-1]] = values
    return found


@pytest.mark.parametrize("drive", ["force", "unicycle"])
def test_rays_turn_with_the_world_in_frames(drive: Any) -> None:
    sensor = RangeSensor(rays=12, range_m=0.9)
    scenario = sensing(sensor, None, sensor, sensor)
    robots = tuple(robot.replace(drive=drive) for robot in scenario.robots)
    scenario = scenario.replace(robots=robots)
    with BatchEnv(scenario, 50, seed=2, num_threads=1) as env:
        names, rows = env.observation_names(), env.reset()
    columns = turning_columns(scenario, names)
    rays = list(columns.rays)
    assert [names[column] for column in rays] == [f"own.ray.{ray}" for ray in range(12)]
    symmetry = SquareSymmetry(columns, torch.device("cpu"), [drive] * 4)
    obs = torch.from_numpy(rows.reshape(-1, rows.shape[-1]).copy())
    form = symmetry.turn(obs, symmetry.frame(obs))
    for element in range(NUM_ELEMENTS):
        turned = symmetry.turn(obs, torch.full((len(obs),), element))
        wanted = turned_by_hand(obs[:, rays].numpy(), element, drive == "unicycle")
        np.testing.assert_array_equal(turned[:, rays], wanted)
        assert torch.equal(symmetry.turn(turned, symmetry.frame(turned)), form)


def test_a_fan_changes_sides_in_a_mirrored_world() -> None:
    scenario = sensing(FAN, FAN, None, FAN)
    with BatchEnv(scenario, 2, num_threads=1) as env:
        columns = turning_columns(scenario, env.observation_names())
    mirrored, same = (4, 3, 2, 1, 0), (0, 1, 2, 3, 4)
    wanted = [same, mirrored, mirrored, same, mirrored, same, same, mirrored]
    assert list(columns.ray_turns) == wanted


@pytest.mark.parametrize("symmetry", ["canonical", "augmented"])
def test_networks_learn_in_frames_with_rays(symmetry: str) -> None:
    scenario = sensing(RangeSensor(rays=8, range_m=0.5))
    config = RunConfig.model_validate({"scenario": scenario, "network": {"symmetry": symmetry}})
    with BatchEnv(scenario, ENVS, num_threads=1) as env:
        build_learner(config, env, training=True)


@pytest.mark.parametrize(
    ("sensors", "message"),
    [
        (
            (None, RangeSensor(rays=9, range_m=0.5), None, None),
            r"robots\[1\].range_sensor.rays: network.symmetry must be 'none' where rays of robots "
            "without a heading are no multiple of 4; --network.symmetry none",
        ),
        (
            (RangeSensor(rays=8, range_m=0.5), None, None, RangeSensor(rays=4, range_m=0.5)),
            r"robots\[3\].range_sensor: network.symmetry must be 'none' where range sensors differ",
        ),
    ],
)
def test_frames_refuse_rays_that_they_cannot_turn(
    sensors: tuple[RangeSensor | None, ...], message: str
) -> None:
    scenario = sensing(*sensors)
    with BatchEnv(scenario, ENVS, num_threads=1) as env:
        names = env.observation_names()
    with pytest.raises(ConfigError, match=message):
        turning_columns(scenario, names)
    assert square_symmetry(scenario, names, torch.device("cpu")) is None


def test_who_measures_nothing_refuses_rays() -> None:
    scenario = sensing(None, RangeSensor(rays=8, range_m=0.5), None, None)
    with pytest.raises(
        ConfigError, match=r"robots\[1\].range_sensor.rays = 8: there must be no range sensor; they"
    ):
        refuse_stores_drives_and_senses(scenario, "they")


@pytest.mark.parametrize("rays", [2, 7, 360])
def test_no_two_rays_are_the_same(rays: int) -> None:
    preset = Scenario.preset("mixed-wheels")

    def rays_of(degrees: float, rays: int = rays) -> np.ndarray:
        sensor = RangeSensor(rays=rays, range_m=1.0, field_of_view_deg=degrees)
        first, *others = preset.robots
        preset.replace(robots=(first.replace(range_sensor=sensor), *others))
        angles = np.array(sensor.angles_rad(), np.float32)
        return np.stack([np.cos(angles), np.sin(angles)], -1)

    for degrees in (360.0, 359.99, 359.0, 1.0):
        assert len(np.unique(rays_of(degrees), axis=0)) == rays
    for degrees in (359.995, 359.9999999):
        with pytest.raises(
            ConfigError,
            match=r"robots\[0\]\.range_sensor\.field_of_view_deg = 359\.99\d+: must be 360, or at "
            r"most 359\.99: the first ray would be the last one, too",
        ):
            rays_of(degrees)
    assert rays_of(359.9999999, 1).tolist() == [[1.0, 0.0]]


@pytest.mark.parametrize(
    ("sensor", "message"),
    [
        ({"rays": 0, "range_m": 1.0}, r"range_sensor.rays = 0: must be in 1..=360"),
        ({"rays": 4, "range_m": 0.05}, "range_m = 0.05: must be above radius_m = 0.05 m"),
        ({"rays": 4, "range_m": 1.0, "field_of_view_deg": 90.0}, "must be 360 of a robot without"),
        ({"rays": 4, "range_m": 1.0, "layers": ["air"]}, 'layers = "air": no robot is in this'),
        ({"rays": 4}, "range_sensor.range_m\n  Field required"),
        ({"rays": 4, "range_m": 1.0, "angle": 1.0}, "range_sensor.angle\n  Extra inputs"),
    ],
)
def test_sensors_that_make_no_sense_are_refused_by_name(
    sensor: dict[str, Any], message: str
) -> None:
    team = [one.model_dump(exclude_defaults=True) for one in Scenario().robots]
    team[0]["range_sensor"] = sensor
    with pytest.raises(ValueError, match=message):
        Scenario.model_validate({"robots": team})
