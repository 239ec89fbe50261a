"""A world that somebody reaches into: what changes, what is refused, and what is told of it."""

from collections.abc import Callable

import numpy as np
import pytest
from fresh_run import config_of_team, make_run, run_config

from innerattn.config import Battery, Scenario
from innerattn.envs import BatchEnv
from innerattn.evaluate.interactive import InteractiveWorld, endless
from innerattn.evaluate.moment import Handoff
from innerattn.evaluate.play import run_episodes
from innerattn.evaluate.trained import load_trained
from innerattn.measures.moments import blocked, handoffs_of_all_robots
from innerattn.policies import PolicyInput, WorldState, scripted_policy
from innerattn.records.record import FIELDS

SEED = 12_345


def world(scenario: Scenario | None = None, *names: str, seed: int = SEED) -> InteractiveWorld:
    scenario = endless(scenario or Scenario.preset("mixed"))
    names = names or ("hungarian", "greedy")
    return InteractiveWorld(
        scenario, {name: scripted_policy(name, scenario, seed) for name in names}, seed
    )


def test_left_alone_it_is_an_episode_of_its_policy() -> None:
    scenario = Scenario.preset("mixed-16").replace(episode_steps=200)
    policy = scripted_policy("hungarian", scenario, SEED)
    record = run_episodes(policy, scenario, 1, SEED, record=FIELDS)
    found = world(scenario)
    stopped, rescues, handoffs = blocked(record), [], []
    for step in range(200):
        moment = found.moment()
        assert (moment.episode, moment.step) == (0, step)
        assert np.array_equal(moment.positions, record.steps["positions"][0, step])
        assert np.array_equal(moment.victims, record.steps["victims"][0, step])
        if step:
            assert np.array_equal(moment.blocked, stopped[0, step - 1])
        found.step()
        rescues += found.moment().rescues
        handoffs += found.moment().handoffs
    assert stopped.any()
    assert len(rescues) > 20
    names = ("step", "victim", "task")
    assert [one[:3] for one in rescues] == [
        tuple(int(event[name]) for name in names) for event in record.rescues
    ]
    assert found.moment().rescued == len(rescues)
    counts = [sum(robot in one.helpers for one in rescues) for robot in range(16)]
    assert list(found.moment().helped) == counts
    fields = ("robot", "before", "after", "first", "second")
    wanted = {Handoff(*(int(row[f]) for f in fields)) for row in handoffs_of_all_robots(record)}
    assert set(handoffs) == wanted
    assert len(wanted) > 3


@pytest.mark.parametrize("actions", ["discrete", "continuous"])
def test_a_steered_robot_does_what_it_is_told(actions: str) -> None:
    scenario = Scenario.preset("mixed").replace(actions=actions, situation="double")
    found, env = world(scenario), BatchEnv(endless(scenario), 1, SEED, num_threads=1)
    env.reset()
    found.steer(2, (-1.0, 0.25))
    policy = scripted_policy("hungarian", scenario, SEED)
    for _ in range(10):
        chosen = policy.act(PolicyInput(env.observe(), WorldState.of(env)))
        chosen[0, 2] = 2 if actions == "discrete" else (-1.0, 0.25)
        env.step(chosen)
        found.step()
    assert np.array_equal(found.moment().positions, env.positions()[0])
    assert found.moment().steered == 2
    found.steer(2, (0.0, 0.0))
    found.steer(None)
    assert found.moment().steered is None


def test_hands_change_what_they_touch_and_nothing_else() -> None:
    found = world()
    before = found.moment()
    found.move_robot(1, 0.5, -0.25)
    found.push_robot(2, 2.0, -1.0)
    found.set_faults(3, {"motor_gain": 0.25, "unavailable": 1.0})
    slot = int(np.flatnonzero(before.victims["present"])[0])
    found.move_victim(slot, -0.5, 0.5)
    after = found.moment()
    assert after.positions[1].tolist() == [0.5, -0.25]
    assert after.velocities[1].tolist() == [0.0, 0.0]
    assert after.velocities[2].tolist() == [2.0, -1.0]
    others = [0, 2, 3]
    assert np.array_equal(after.positions[others], before.positions[others])
    assert (after.faults["motor_gain"][3], after.faults["unavailable"][3]) == (0.25, 1.0)
    assert (after.faults[:3] == before.faults[:3]).all()
    assert [float(after.victims[axis][slot]) for axis in "xy"] == [-0.5, 0.5]
    assert after.victims["id"][slot] == before.victims["id"][slot]
    assert after.step == before.step == 0
    found.restart()
    assert found.moment().episode == 1
    assert (found.moment().faults == before.faults).all()


def test_a_victim_is_added_where_there_is_room() -> None:
    found = world(Scenario.preset("mixed").replace(max_victims=3))
    free = 3 - int(found.moment().victims["present"].sum())
    for number in range(free):
        found.add_victim(1, 0.1 * number, 0.2)
    assert found.moment().victims["present"].all()
    with pytest.raises(ValueError, match="all 3 places for victims are taken"):
        found.add_victim(0, 0.0, 0.0)


@pytest.mark.parametrize("situation", ["poisson", "listed"])
def test_a_victim_is_added_in_a_slot_of_its_task(situation: str) -> None:
    found = world(Scenario.preset("mixed").replace(situation=situation, max_victims=2))
    for _ in range(2):
        found.add_victim(1, 0.1, 0.2)
    assert found.moment().victims["present"].tolist() == [False, False, True, True]
    with pytest.raises(ValueError, match="all 2 places for victims are taken"):
        found.add_victim(1, 0.0, 0.0)
    found.add_victim(0, 0.0, 0.0)
    assert found.moment().victims["present"].tolist() == [True, False, True, True]
    with pytest.raises(ValueError, match="places for victims are taken"):
        found.add_victim(2, 0.0, 0.0)


Attempt = Callable[[InteractiveWorld], None]
REFUSED: list[tuple[str, Attempt]] = [
    (r"robot = 4: must be in 0\.\.=3", lambda w: w.move_robot(4, 0, 0)),
    (r"robot = -1: must be in", lambda w: w.set_faults(-1, {"blackout": 1.0})),
    (r"x = 0.96: must be in -0.95\.\.=0.95 m", lambda w: w.move_robot(0, 0.96, 0)),
    (r"y = nan: must be in", lambda w: w.move_robot(0, 0, float("nan"))),
    (r"vx = 6: must be in -5\.\.=5 m/s", lambda w: w.push_robot(0, 6, 0)),
    (r"fault 'rust': must be one of motor_gain", lambda w: w.set_faults(0, {"rust": 1.0})),
    (
        r"faults\[motor_gain, env 0, robot 1\] = 2: must be in 0\.\.=1",
        lambda w: w.set_faults(1, {"blackout": 1.0, "motor_gain": 2.0}),
    ),
    ("slot = 9: holds no victim", lambda w: w.move_victim(9, 0, 0)),
    (r"victims\[x, env 0, slot 0\] = 0.95", lambda w: w.move_victim(0, 0.95, 0)),
    ("policy = 'nobody': must be one of hungarian", lambda w: w.choose_policy("nobody")),
    (r"drive x = 2: must be in -1\.\.=1", lambda w: w.steer(0, (2, 0))),
]


@pytest.mark.parametrize(("message", "attempt"), REFUSED, ids=[text for text, _ in REFUSED])
def test_what_is_refused_changes_nothing(message: str, attempt: Attempt) -> None:
    found, untouched = world(), world()
    with pytest.raises(ValueError, match=message):
        attempt(found)
    for _ in range(5):
        found.step()
        untouched.step()
    assert found.moment().steered is None
    assert np.array_equal(found.moment().positions, untouched.moment().positions)


def test_another_policy_goes_on_from_the_same_state() -> None:
    found = world()
    for _ in range(4):
        found.step()
    before = found.moment()
    found.choose_policy("greedy")
    after = found.moment()
    assert after.policy == "greedy"
    assert after.step == before.step
    assert np.array_equal(after.positions, before.positions)


def test_attention_is_that_of_a_critic_with_one(tmp_path_factory: pytest.TempPathFactory) -> None:
    for method, has in (("td-inner", True), ("mappo", False)):
        run = make_run(tmp_path_factory.mktemp("run") / "r", run_config(method))
        config, policy = load_trained(run)
        found = InteractiveWorld(endless(config.scenario), {"run": policy}, 1)
        found.step()
        weights = found.moment().attention
        assert (weights is not None) == has
        if weights is not None:
            assert weights.shape[1:] == (4, 4)
            assert weights.sum(-1) == pytest.approx(1.0, abs=1e-5)


def test_a_lone_robot_acts(tmp_path_factory: pytest.TempPathFactory) -> None:
    run = make_run(tmp_path_factory.mktemp("run") / "r", config_of_team(1))
    config, policy = load_trained(run)
    found = InteractiveWorld(endless(config.scenario), {"run": policy}, 1)
    found.step()
    assert found.moment().attention is None
    assert found.moment().step == 1


def test_an_endless_world_ends_at_last_and_goes_on() -> None:
    scenario = Scenario.preset("mixed").replace(episode_steps=3)
    found = InteractiveWorld(scenario, {"greedy": scripted_policy("greedy", scenario)}, 0)
    for _ in range(4):
        found.step()
    assert (found.moment().episode, found.moment().step) == (1, 1)
    assert endless(scenario.replace(end_when_rescued=1)).end_when_rescued is None
    listed = scenario.replace(situation="listed", end_when_done=True)
    assert not endless(listed).ends_early


def test_charges_are_told_where_robots_have_a_battery() -> None:
    plain = Scenario.preset("mixed")
    battery = Battery(capacity_j=5.0, per_m_j=0.0, idle_w=2.0)
    powered = plain.replace(robots=(plain.robots[0].replace(battery=battery), *plain.robots[1:]))
    found = world(powered)
    for _ in range(5):
        found.step()
    charge = found.moment().charge
    assert charge is not None
    assert charge.tolist() == pytest.approx([0.8, 1.0, 1.0, 1.0])
    assert world(plain).moment().charge is None


@pytest.mark.parametrize("actions", ["discrete", "continuous"])
@pytest.mark.parametrize("drive", ["unicycle", "differential"])
def test_robots_on_wheels_are_steered_as_they_point(drive: str, actions: str) -> None:
    plain = Scenario.preset("mixed").replace(actions=actions, engine="none")
    first, *others = plain.robots
    robots = (first.replace(drive=drive, start_m=(0.0, 0.0)), *others)
    found = world(plain.replace(robots=robots))
    assert world(plain).moment().headings is None
    headings = found.moment().headings
    assert headings is not None
    angle = float(headings[0, 0])
    found.steer(0, (0.0, 1.0))
    for _ in range(3):
        found.step()
    ahead = np.array([np.cos(angle), np.sin(angle)])
    np.testing.assert_allclose(found.moment().positions[0], 0.25 * ahead, atol=1e-5)
    assert not found.moment().blocked[0]
    found.steer(0, (-1.0, 0.0))
    found.step()
    headings = found.moment().headings
    assert headings is not None
    assert headings[0, 1] > 0.0  # to the left


def test_loads_are_told_where_robots_have_one() -> None:
    plain = Scenario.preset("mixed").replace(rescue_radius_m=3.0)
    loaded = plain.replace(robots=(plain.robots[0].replace(load=4), *plain.robots[1:]))
    found = world(loaded)
    while found.moment().helped[0] < 3:
        found.step()
    load = found.moment().load
    assert load is not None
    assert load.tolist() == [0.25, 1.0, 1.0, 1.0]
    assert world(plain).moment().load is None
