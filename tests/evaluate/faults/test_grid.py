"""The grid of faults: what is played, and what of it is retained."""

import numpy as np
import pytest

from innerattn.config import Scenario
from innerattn.envs.batch import FAULT_KINDS
from innerattn.evaluate.faults.document import robustness_document, worst_robot
from innerattn.evaluate.faults.grid import Grid, play, play_all, rescues_by_step, retention_of
from innerattn.evaluate.play import run_episodes
from innerattn.policies import scripted_policy

WORLDS = Scenario.preset("double").replace(episode_steps=20, rescue_radius_m=0.3)
SMALL = Grid(WORLDS, kinds=("unavailable", "blackout"), severities=(0.5, 1.0), episodes=12, seed=4)


def test_each_cell_is_one_fault_of_one_robot() -> None:
    scenario = SMALL.worlds("blackout", 0.5, 2, "middle")
    (fault,) = scenario.faults
    assert (fault.robot, fault.kind, fault.value) == ("navigation_0", "blackout", 0.5)
    assert fault.onset_step == SMALL.middle == 10
    assert scenario.replace(faults=()) == WORLDS
    assert SMALL.worlds("blackout", 0.5, 2, "start").faults[0].onset_step == 0


def test_rescues_by_step_are_those_of_the_record() -> None:
    record = run_episodes(scripted_policy("greedy", WORLDS), WORLDS, 30, 1, first_episode=7)
    counts = rescues_by_step(record)
    assert counts.shape == (30, 20)
    np.testing.assert_array_equal(counts.sum(1), record.rescue_counts())
    np.testing.assert_array_equal(counts.sum(0), np.bincount(record.rescues["step"], minlength=20))


def test_worlds_are_the_same_until_the_fault_begins() -> None:
    played = play(scripted_policy("hungarian", WORLDS), SMALL)
    assert played.faulty.shape == (2, 2, 4, 2, 12, 20)
    middle = played.faulty[:, :, :, 1]
    # A rescue at the end of step 9 is the last that a fault from step 10 on cannot touch.
    np.testing.assert_array_equal(
        middle[..., :10], np.broadcast_to(played.clean[:, :10], middle[..., :10].shape)
    )
    assert (played.faulty[0, 1, :, 0] != played.clean).any()
    # Scripts see the true state: a blackout is nothing to them.
    np.testing.assert_array_equal(
        played.faulty[1], np.broadcast_to(played.clean, played.faulty[1].shape)
    )


def test_drawn_actions_are_the_same_until_the_fault_begins() -> None:
    """Not what the policy did under other faults decides what it draws, so cells stay pairs."""
    near = WORLDS.replace(rescue_radius_m=0.4)  # chance alone rescues
    grid = Grid(near, ("blackout", "motor_gain"), severities=(0.5, 1.0), episodes=12, seed=5)
    played = play(scripted_policy("random", near, 3), grid)
    assert played.clean[:, :10].sum() > 0
    middle = played.faulty[:, :, :, 1, :, :10]
    np.testing.assert_array_equal(middle, np.broadcast_to(played.clean[:, :10], middle.shape))
    np.testing.assert_array_equal(
        played.faulty[0], np.broadcast_to(played.clean, played.faulty[0].shape)
    )


def test_severity_0_retains_everything_and_the_worst_loses_the_only_medic() -> None:
    grid = Grid(WORLDS, FAULT_KINDS, severities=(0.0, 1.0), episodes=8, seed=1)
    nothing = play_all([("greedy", scripted_policy("greedy", WORLDS))], grid)["greedy"]
    np.testing.assert_array_equal(nothing.cells.value[:, 0], 1.0)
    assert (nothing.cells.value[:, 1] < 1.0).any()
    single = WORLDS.replace(situation="single", tasks=WORLDS.tasks[:1])
    grid = Grid(single, ("unavailable",), severities=(1.0,), episodes=20, seed=1)
    lost = play_all([("hungarian", scripted_policy("hungarian", single))], grid)["hungarian"]
    assert lost.cells.value[0, 0, 3].tolist() == [0.0, 0.0]  # medical_0
    assert (lost.cells.value[0, 0, 2] > 0.8).all()  # navigation_0 is not needed
    assert worst_robot(grid, lost, 0)[0] == "medical_0"
    assert worst_robot(grid, lost, 0)[1].mean == 0.0


def test_retention_is_the_ratio_since_the_onset() -> None:
    played = play(scripted_policy("hungarian", WORLDS), SMALL)
    found = retention_of(played, SMALL)
    clean, faulty = played.clean, played.faulty
    assert found.cells.value[0, 1, 2, 0] == pytest.approx(faulty[0, 1, 2, 0].sum() / clean.sum())
    late = faulty[0, 1, 2, 1, :, 10:].sum() / clean[:, 10:].sum()
    assert found.cells.value[0, 1, 2, 1] == pytest.approx(late)
    assert found.early.retention.value[0, 1, 2] == pytest.approx(
        faulty[0, 1, 2, 1, :, 10:15].sum() / clean[:, 10:15].sum()
    )
    assert found.late.retention.value[0, 1, 2] == pytest.approx(
        faulty[0, 1, 2, 1, :, 15:].sum() / clean[:, 15:].sum()
    )
    half, worst = found.cells.value[0, :, 1, 0]
    assert found.areas.value[0, 1, 0] == pytest.approx(0.25 * (1 + half) + 0.25 * (half + worst))
    assert found.clean.value == pytest.approx(clean.sum() / 12)


def test_rescues_are_counted_beside_retention() -> None:
    played = play(scripted_policy("hungarian", WORLDS), SMALL)
    found, clean, faulty = retention_of(played, SMALL), played.clean, played.faulty
    windows = ((found.start, 0, 0, 20), (found.middle, 1, 10, 20))
    windows += ((found.early, 1, 10, 15), (found.late, 1, 15, 20))
    for window, onset, first, last in windows:
        assert window.clean.value == pytest.approx(clean[:, first:last].sum() / 12)
        for k, s, r in np.ndindex(2, 2, 4):
            expected = faulty[k, s, r, onset, :, first:last].sum() / 12
            assert window.rescues.value[k, s, r] == pytest.approx(expected)
            assert window.retention.value[k, s, r] == pytest.approx(expected / window.clean.value)
    for k in range(2):
        of_robots = []
        for r in range(4):
            half, worst = (faulty[k, s, r, 0].sum() / 12 for s in (0, 1))
            area = 0.25 * (clean.sum() / 12 + half) + 0.25 * (half + worst)
            of_robots.append(area)
        assert found.rescues_by_kind.value[k] == pytest.approx(np.mean(of_robots))
    interval = found.rescues_by_kind[0].estimate()
    assert interval.low < interval.mean < interval.high


@pytest.mark.parametrize(("situation", "ceiling"), [("double", (0.4, 0.8)), ("mixed", (0.0, 0.2))])
def test_recovery_has_room_in_double_and_none_in_mixed(
    situation: str, ceiling: tuple[float, float]
) -> None:
    """Without its only medic no team goes on in mixed: the next wave never appears."""
    worlds = Scenario.preset(situation).replace(episode_steps=100)
    grid = Grid(worlds, ("unavailable",), severities=(1.0,), episodes=20, seed=1)
    oracle = play_all([("oracle", scripted_policy("oracle", worlds))], grid)["oracle"]
    medic = [robot.name for robot in worlds.robots].index("medical_0")
    assert ceiling[0] <= oracle.late.retention.value[0, 0, medic] <= ceiling[1]


def test_the_document_holds_every_cell_and_is_the_same_twice() -> None:
    policies = [(name, scripted_policy(name, WORLDS)) for name in ("greedy", "oracle")]
    calls: list[tuple[int, int]] = []
    documents = [
        robustness_document(
            SMALL, play_all(policies, SMALL, progress=lambda *x: calls.append(x)), {}
        )
        for _ in range(2)
    ]
    assert documents[0] == documents[1]
    (found, _) = documents
    assert [policy["policy"] for policy in found["policies"]] == ["greedy", "oracle"]
    assert len(found["policies"][0]["cells"]) == 2 * 2 * 4 * 2
    assert found["differences"][0]["by_kind"]["blackout"]["mean"] == 0.0
    assert found["onset_steps"] == {"start": 0, "middle": 10}
    for policy in found["policies"]:
        rescues = policy["rescues_per_episode"]["mean"]
        assert policy["rescues_with_fault"].keys() == {"unavailable", "blackout", "all"}
        assert 0.0 < policy["rescues_with_fault"]["all"]["mean"] <= rescues
        for cell in policy["cells"]:
            if cell["onset"] == "start":
                ratio = cell["rescues"]["mean"] / rescues
                assert cell["retention"]["mean"] == pytest.approx(ratio)
        without = policy["after_onset_without_fault"]
        for kind in policy["after_onset"].values():
            assert kind["late_rescues"]["mean"] <= without["late_rescues"]["mean"] * 1.2
            for part in ("early", "late"):
                ratio = kind[f"{part}_rescues"]["mean"] / without[f"{part}_rescues"]["mean"]
                assert kind[part]["mean"] == pytest.approx(ratio)
    assert calls[-1] == (2 * 12 * 33, 2 * 12 * 33)
