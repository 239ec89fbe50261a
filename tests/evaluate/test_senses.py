"""What robots heard and measured, in records: against the worlds themselves and through files."""

from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from sensing import sensing

from innerattn.config import Scenario
from innerattn.config.range_sensor import RangeSensor
from innerattn.envs import BatchEnv
from innerattn.evaluate.play import run_episodes
from innerattn.policies import PolicyInput, WorldState, scripted_policy
from innerattn.records import read_records, write_records
from innerattn.records.record import FIELDS, Record
from innerattn.records.validity import refuse_impossible

SEED = 12_345


def recorded(scenario: Scenario, episodes: int = 4) -> Record:
    policy = scripted_policy("hungarian", scenario)
    return run_episodes(policy, scenario, episodes, SEED, record=FIELDS)


def test_records_keep_who_hears_whom_and_what_rays_read() -> None:
    scenario = sensing().replace(episode_steps=10)
    record, policy = recorded(scenario), scripted_policy("hungarian", scenario)
    heard, rays = record.steps["heard"], record.steps["rays"]
    assert rays.shape == (4, 10, 4, 12)
    with closing(BatchEnv(scenario, 4, seed=SEED)) as env:
        names = env.observation_names()
        obs = env.reset()
        for step in range(10):
            np.testing.assert_array_equal(heard[:, step], env.heard())
            for ray in range(12):
                column = obs[..., names.index(f"own.ray.{ray}")]
                np.testing.assert_array_equal(rays[:, step, :, ray], column)
            obs = env.step(policy.act(PolicyInput(obs, WorldState.of(env)))).obs
    assert heard.any()
    assert not heard[:, 0].any()  # what is sent is on its way
    assert (rays > 0).any()
    assert (rays == 0).any()


def test_rays_end_on_what_they_meet() -> None:
    scenario = sensing()
    record = recorded(scenario, 30)
    half = scenario.arena_half_width_m
    radii = [robot.radius_m for robot in scenario.robots]
    met = 0
    for robot, described in enumerate(scenario.robots):
        sensor = described.range_sensor
        if sensor is None:
            assert not record.steps["rays"][:, :, robot].any()
            continue
        places: NDArray[np.float64] = record.steps["positions"].astype(np.float64)
        ahead = record.steps["headings"][:, :, robot, 0]
        for ray, angle in enumerate(sensor.angles_rad()):
            reading = record.steps["rays"][:, :, robot, ray]
            far = (1.0 - reading) * sensor.range_m
            way = np.stack([np.cos(ahead + angle), np.sin(ahead + angle)], -1)
            ends = places[:, :, robot] + far[..., None] * way
            gaps = [np.abs(half - np.abs(ends[..., axis])) for axis in (0, 1)]
            for other, radius in enumerate(radii):
                if other != robot:
                    away = np.linalg.norm(ends - places[:, :, other], axis=-1)
                    gaps.append(np.abs(away - radius))
            off = np.min(gaps, axis=0)[reading > 0]
            assert (off < 1e-4).all()
            met += len(off)
    assert met > 500


def test_angles_of_rays() -> None:
    def degrees(rays: int, field: float) -> NDArray[np.float64]:
        sensor = RangeSensor(rays=rays, range_m=1.0, field_of_view_deg=field)
        return np.degrees(sensor.angles_rad())

    np.testing.assert_allclose(degrees(4, 360.0), [0, 90, 180, 270])
    np.testing.assert_allclose(degrees(3, 120.0), [-60, 0, 60])
    np.testing.assert_allclose(degrees(1, 120.0), [0])


def test_records_come_back_from_files(tmp_path: Path) -> None:
    record = recorded(sensing().replace(episode_steps=10))
    write_records([record], tmp_path)
    (back,) = read_records(tmp_path)
    for name in ("heard", "rays"):
        np.testing.assert_array_equal(back.steps[name], record.steps[name], strict=True)


def test_worlds_without_such_senses_record_none() -> None:
    steps = recorded(Scenario.preset("mixed").replace(episode_steps=5)).steps
    assert "heard" not in steps
    assert "rays" not in steps


def test_senses_that_no_play_leaves_behind_are_refused() -> None:
    record = recorded(sensing().replace(episode_steps=10))
    refuse_impossible(record)
    itself = record.steps["heard"].copy()
    itself[0, 0, 1, 1] = True
    plain = Scenario.preset("mixed-wheels").replace(episode_steps=10)
    wrong = {
        "heard: no robot hears itself": {"heard": itself},
        r"heard: must have shape \(..., 4, 4\)": {"heard": itself[..., :3]},
        r"rays: must have shape \(..., 4, 12\)": {"rays": record.steps["rays"][..., :11]},
        r"rays: must be in 0..=1": {"rays": record.steps["rays"] + np.float32(0.5)},
    }
    for message, steps in wrong.items():
        with pytest.raises(ValueError, match=message):
            refuse_impossible(replace(record, steps=record.steps | steps))
    with pytest.raises(ValueError, match="heard: must not be recorded in a scenario without it"):
        refuse_impossible(replace(record, scenario=plain))
