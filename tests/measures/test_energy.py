"""Energy and empty batteries, against the charges of the worlds themselves."""

from pathlib import Path

import numpy as np
import pytest

from innerattn.config import Battery, Fault, Scenario, Station
from innerattn.evaluate.play import run_episodes
from innerattn.measures import measures_of, needed_fields
from innerattn.policies import scripted_policy
from innerattn.records import Record, read_records, write_records
from innerattn.stats import Estimate

PLAIN = Scenario.preset("mixed")
CAPACITY_J = 6.0
BATTERY = Battery(capacity_j=CAPACITY_J, per_m_j=3.0, idle_w=1.0)
SOME = PLAIN.replace(
    robots=(*(one.replace(battery=BATTERY) for one in PLAIN.robots[:3]), PLAIN.robots[3]),
    episode_steps=15,
)
"""Three robots with a battery, which no station charges."""


def played(scenario: Scenario, episodes: int = 12) -> Record:
    policy = scripted_policy("hungarian", scenario)
    return run_episodes(policy, scenario, episodes, 3, record=needed_fields(scenario))


def value(record: Record, name: str) -> Estimate:
    found = measures_of(record)[name]
    assert isinstance(found, Estimate)
    return found


@pytest.mark.parametrize("leaves", [False, True])
def test_without_stations_energy_is_what_batteries_lack(leaves: bool) -> None:
    scenario = SOME
    if leaves:  # they come back elsewhere, which costs nothing
        away = Fault(
            robot="food_0", kind="unavailable", value=1.0, onset_rate_hz=1.0, duration_steps=3
        )
        scenario = SOME.replace(faults=(away,), unavailable_robots="leave")
    record = played(scenario)
    last = record.steps["charge"][:, -1, :3].astype(np.float64)
    lacking = CAPACITY_J * (1.0 - last).sum(1)
    assert value(record, "energy_j").mean == pytest.approx(lacking.mean(), rel=1e-4)
    assert 4.0 < lacking.mean() < 3 * CAPACITY_J


def test_with_stations_more_than_full_batteries_is_given() -> None:
    station = Station(position_m=(0.0, 0.0), radius_m=0.4, recharge_w=30.0)
    record = played(SOME.replace(stations=(station,), episode_steps=200))
    assert value(record, "energy_j").mean > 3 * CAPACITY_J
    assert value(record, "empty").mean < 0.05


def test_empty_is_a_share_of_the_steps_of_robots_with_a_battery() -> None:
    record = played(SOME)
    charge = record.steps["charge"]
    assert (charge[..., 3] == 1.0).all()
    count = sum(
        charge[episode, step, robot] == 0.0
        for episode in range(12)
        for step in range(record.lengths[episode])
        for robot in range(3)
    )
    assert value(record, "empty").mean == pytest.approx(count / (3 * record.lengths.sum()))
    assert 0.0 < value(record, "empty").mean < 1.0


def test_steps_after_the_end_of_an_episode_do_not_count() -> None:
    record = played(SOME.replace(end_when_rescued=1), episodes=20)
    assert len({*record.lengths}) > 1
    rows = np.arange(20), record.lengths - 1
    last = record.steps["charge"][rows][:, :3].astype(np.float64)
    lacking = CAPACITY_J * (1.0 - last).sum(1)
    assert value(record, "energy_j").mean == pytest.approx(lacking.mean(), rel=1e-4)


def test_charges_are_stored_and_read_again(tmp_path: Path) -> None:
    record = played(SOME)
    write_records([record], tmp_path)
    (again,) = read_records(tmp_path)
    np.testing.assert_array_equal(again.steps["charge"], record.steps["charge"])
    assert measures_of(again) == measures_of(record)


def test_worlds_without_batteries_have_neither() -> None:
    assert "charge" not in needed_fields(PLAIN)
    record = run_episodes(scripted_policy("greedy", PLAIN), PLAIN, 2, 3, record=("charge",))
    assert "charge" not in record.steps
    assert not {"energy_j", "empty"} & measures_of(record).keys()
