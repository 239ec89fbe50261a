"""The grid of faults: what is played, and what of it is kept."""

import numpy as np
import pytest

from innerattn.config import Scenario
from innerattn.envs.batch import FAULT_KINDS
from innerattn.evaluate.faults.document import robustness_document, worst_robot
from innerattn.evaluate.faults.grid import Grid, kept, play, play_all, rescues_by_step
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


def test_no_severity_keeps_everything_and_the_worst_loses_the_only_medic() -> None:
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


def test_what_is_kept_is_the_ratio_since_the_onset() -> None:
    played = play(scripted_policy("hungarian", WORLDS), SMALL)
    found = kept(played, SMALL)
    clean, faulty = played.clean, played.faulty
    assert found.cells.value[0, 1, 2, 0] == pytest.approx(faulty[0, 1, 2, 0].sum() / clean.sum())
    late = faulty[0, 1, 2, 1, :, 10:].sum() / clean[:, 10:].sum()
    assert found.cells.value[0, 1, 2, 1] == pytest.approx(late)
    assert found.early.value[0, 1, 2] == pytest.approx(
        faulty[0, 1, 2, 1, :, 10:15].sum() / clean[:, 10:15].sum()
    )
    assert found.late.value[0, 1, 2] == pytest.approx(
        faulty[0, 1, 2, 1, :, 15:].sum() / clean[:, 15:].sum()
    )
    half, worst = found.cells.value[0, :, 1, 0]
    assert found.areas.value[0, 1, 0] == pytest.approx(0.25 * (1 + half) + 0.25 * (half + worst))
    assert found.clean.value == pytest.approx(clean.sum() / 12)


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
    assert calls[-1] == (2 * 12 * 33, 2 * 12 * 33)
