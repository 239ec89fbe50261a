"""Faults through the batch: reading them, setting them, and refusing bad ones."""

import re

import numpy as np
import pytest
from worlds import CROWDED, batch, image, plan

from innerattn.config import Fault, Scenario
from innerattn.envs import BatchEnv

HALF_MOTOR = Fault(robot="food_1", kind="motor_gain", value=0.5, onset_step=2)


def test_the_state_names_what_is_in_effect() -> None:
    env = batch(2, CROWDED.replace(faults=(HALF_MOTOR,)))
    healthy = env.fault_state()
    assert healthy.shape == (2, 4)
    assert healthy["motor_gain"].dtype == np.float32
    for kind in healthy.dtype.names or ():
        assert (healthy[kind] == (kind in ("motor_gain", "speed_limit"))).all()
    for actions in plan(2, 2):
        env.step(actions)
    assert env.fault_state()["motor_gain"].tolist() == [[1, 0.5, 1, 1]] * 2


def test_what_is_read_can_be_set_and_read_again() -> None:
    env = batch(3, CROWDED)
    faults = env.fault_state()
    for index, kind in enumerate(faults.dtype.names or ()):
        faults[kind][:, index % 4] = 0.25
    env.set_faults(faults)
    assert (env.fault_state() == faults).all()
    before = env.snapshot()
    env.set_faults(env.fault_state())
    assert env.snapshot() == before


def test_a_mask_chooses_worlds_and_leaves_the_others_to_the_bit() -> None:
    changed, untouched = batch(4), batch(4)
    faults = changed.fault_state()
    faults["heading_bias"] = 1.0
    strided = np.array([False, False, True, True, False, False, True, True])[::2]
    changed.set_faults(faults, mask=strided)
    different = False
    for actions in plan(30, 4):
        steps = changed.step(actions), untouched.step(actions)
        for world in (0, 2):
            one = slice(world, world + 1)
            images = [
                image(step, env, one) for step, env in zip(steps, (changed, untouched), strict=True)
            ]
            assert images[0] == images[1]
        different |= not np.array_equal(steps[0].obs[1], steps[1].obs[1])
    assert different


def test_a_reset_brings_the_scenarios_faults_back() -> None:
    env = batch(2, CROWDED.replace(faults=(HALF_MOTOR.replace(onset_step=0),)))
    faults = env.fault_state()
    faults["motor_gain"] = 0.0
    env.set_faults(faults)
    env.reset(mask=np.array([True, False]))
    assert env.fault_state()["motor_gain"].tolist() == [[1, 0.5, 1, 1], [0, 0, 0, 0]]


def test_faults_in_the_observation() -> None:
    env = batch(1, CROWDED.replace(faults=(HALF_MOTOR.replace(onset_step=0),), observe_faults=True))
    names = env.observation_names()
    assert env.obs_width == BatchEnv(CROWDED, 1).obs_width + 4 * 8
    obs = env.observe()[0]
    assert obs[1, names.index("own.fault.motor_gain")] == 0.5
    assert obs[0, names.index("teammate_0.fault.motor_gain")] == 0.5
    assert obs[0, names.index("own.fault.motor_gain")] == 1.0
    assert obs[0, names.index("own.fault.blackout")] == 0.0


def _broken(kind: str, value: float) -> np.ndarray:
    faults = batch(3).fault_state()
    faults[kind][1, 2] = value
    return faults


@pytest.mark.parametrize(
    ("faults", "error", "message"),
    [
        (
            _broken("motor_gain", -0.5),
            ValueError,
            r"^faults\[motor_gain, env 1, robot 2\] = -0.5: ",
        ),
        (_broken("speed_limit", 1.5), ValueError, r"must be in 0\.\.=1"),
        (_broken("heading_bias", 4.0), ValueError, r"must be in -3\.14.*\.\.=3\.14.* rad"),
        (_broken("position_noise", np.nan), ValueError, "position_noise.*NaN"),
        (_broken("velocity_noise", np.inf), ValueError, "velocity_noise.*inf"),
        (_broken("blackout", 2.0), ValueError, r"blackout, env 1, robot 2"),
        (np.ones((3, 4)), TypeError, "must have the fields motor_gain, speed_limit"),
        (_broken("blackout", 1.0)[["blackout"]], TypeError, "must have the fields"),
        (_broken("blackout", 1.0)[:2], ValueError, r"must have shape \(3, 4\)"),
        (_broken("blackout", 1.0)[0], ValueError, r"must have shape \(3, 4\)"),
    ],
)
def test_bad_faults_change_nothing(
    faults: np.ndarray, error: type[Exception], message: str
) -> None:
    env = batch(3)
    before, obs = env.snapshot(), env.observe().copy()
    with pytest.raises(error, match=message) as raised:
        env.set_faults(faults)
    assert "\n" not in str(raised.value)
    assert env.snapshot() == before
    assert (env.observe() == obs).all()


@pytest.mark.parametrize(
    ("mask", "error"), [([1, 0, 1], TypeError), ([True, False], ValueError), (True, ValueError)]
)
def test_bad_masks_change_nothing(mask: object, error: type[Exception]) -> None:
    env = batch(3)
    before = env.snapshot()
    with pytest.raises(error, match="mask has"):
        env.set_faults(_broken("blackout", 1.0), mask=mask)
    assert env.snapshot() == before


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"value": -0.5}, r"scenario.faults[0].value (motor_gain) = -0.5: must be in 0..=1"),
        ({"value": float("nan")}, "faults"),
        ({"kind": "rust"}, "kind"),
        ({"robot": "food_9"}, 'faults[0].robot = "food_9": no such robot; the team has food_0, '),
        ({"onset_step": 40}, "faults[0].onset_step = 40: must be before the end of the episode"),
        ({"onset_step": -1}, "onset_step"),
        ({"onset_rate_hz": 0.0}, "faults[0].onset_rate_hz = 0: must be in 0.000001..=1000 1/s"),
        ({"duration_steps": 0}, "faults[0].duration_steps = 0: must be in 1..="),
        ({"kind": "position_noise", "value": 11.0}, "(position_noise) = 11: must be in 0..=10 m"),
        ({"severity": 1.0}, "severity"),
    ],
)
def test_bad_descriptions_are_refused(change: dict[str, object], message: str) -> None:
    fault = HALF_MOTOR.model_dump() | change
    with pytest.raises(ValueError, match=re.escape(message)):
        Scenario.model_validate(CROWDED.model_dump() | {"faults": [fault]})
