"""Attention of fresh runs when robots fail: the worlds that are played, and what is refused."""

import json
from pathlib import Path

import numpy as np
import pytest
from fresh_run import config_of_team, make_run, run_config

from innerattn.config import Scenario
from innerattn.errors import RunError
from innerattn.evaluate.faults.attention import fault_attention_of_run, paired_rollouts
from innerattn.evaluate.faults.severity import fault_of
from innerattn.evaluate.play import run_episodes
from innerattn.evaluate.trained import load_trained
from innerattn.measures.faults.shift_results import FaultAttention
from innerattn.records.record import Record
from innerattn.stats import Estimate

SOME = ("motor_gain", "blackout")


def small(run: Path, **options: object) -> FaultAttention:
    return fault_attention_of_run(run, **{"episodes": 6, "steps": 8, **options})


def played(run: Path, kind: str | None, robot: int, greedy: bool | None = None) -> Record:
    """8 steps of 6 worlds, in which a robot fails at the fourth in the worst way."""
    worlds = run_config("td-inner").scenario.replace(episode_steps=8)
    if kind is not None:
        worlds = worlds.replace(faults=(fault_of(worlds, robot, kind, 1.0, 4),))
    _, policy = load_trained(run, worlds, greedy=greedy)
    return run_episodes(
        policy, worlds, 6, 5, record=("attention", "actions", "faults"), num_threads=1
    )


def test_a_run(tmp_path: Path) -> None:
    run = make_run(tmp_path / "run", run_config("td-inner"))
    calls: list[tuple[int, int]] = []
    kinds = (*SOME, "unavailable")
    found = small(run, kinds=kinds, progress=lambda done, total: calls.append((done, total)))
    assert calls == [(k + 1, 13) for k in range(13)]
    assert (found.attention, found.episodes, found.counted) == ("inner", 6, 6)
    assert (found.episode_steps, found.onset_step) == (8, 4)
    assert found.seed == run_config("td-inner").evaluate.seed
    assert found.even_share == 1 / 3
    assert [kind.kind for kind in found.kinds] == list(kinds)
    names = [robot.name for robot in Scenario().robots]
    for kind in found.kinds:
        assert [shift.robot for shift in kind.robots] == names
        effects = [shift.effect.mean.mean for shift in kind.robots]
        assert kind.effect.mean.mean == pytest.approx(np.mean(effects))
        assert len(kind.effect.heads) == len(kind.auc.heads) == 4
        for shift in kind.robots:
            assert shift.effect_curve[:4] == (Estimate(0.0, 0.0, 0.0),) * 4
    effects = [kind.effect.mean.mean for kind in found.kinds]
    assert found.effect.mean.mean == pytest.approx(np.mean(effects))
    areas = [kind.auc.mean.mean for kind in found.kinds]
    assert found.auc.mean.mean == pytest.approx(np.mean(areas))
    document = found.to_json()
    assert json.loads(json.dumps(document, allow_nan=False)) == json.loads(json.dumps(document))
    assert document["schema_version"] == 1


@pytest.mark.parametrize("greedy", [True, False])
@pytest.mark.parametrize("kind", ["motor_gain", "blackout"])
def test_worlds_are_the_same_to_the_bit_until_the_onset(
    kind: str, greedy: bool, tmp_path: Path
) -> None:
    run = make_run(tmp_path / "run", run_config("td-inner"))
    healthy, faulty = played(run, None, 2, greedy), played(run, kind, 2, greedy)
    for name in ("attention", "actions"):
        np.testing.assert_array_equal(faulty.steps[name][:, :4], healthy.steps[name][:, :4])
    one, other = faulty.steps["attention"][:, 4:], healthy.steps["attention"][:, 4:]
    assert not np.array_equal(one, other)
    is_faulty = faulty.steps["faults"] != healthy.steps["faults"]
    assert is_faulty[:, 4:, 2].all()
    assert is_faulty.sum() == is_faulty[:, 4:, 2].sum()


def test_figures_are_of_the_worlds_that_are_played(tmp_path: Path) -> None:
    run = make_run(tmp_path / "run", run_config("td-inner"))
    found = small(run, kinds=("blackout",), seed=5)
    rollouts = paired_rollouts(played(run, "blackout", 2), played(run, None, 2), 2, 4)
    received = rollouts.received()
    shift = found.kinds[0].robots[2]
    assert shift.effect.mean.mean == pytest.approx(received.effects()[:, 0].mean())
    assert shift.before.mean.mean == pytest.approx(received.faulty[:, :4, 0].mean())


def test_episodes_that_end_before_the_onset_do_not_count(tmp_path: Path) -> None:
    run = make_run(tmp_path / "run", run_config("td-inner"))
    faulty, healthy = played(run, "blackout", 1), played(run, None, 1)
    faulty.lengths[:], healthy.lengths[:] = [4, 5, 8, 8, 2, 7], [4, 8, 6, 8, 2, 7]
    rollouts = paired_rollouts(faulty, healthy, 1, 4)
    assert rollouts.happened.sum(1).tolist() == [5, 6, 8, 7]
    np.testing.assert_array_equal(rollouts.faulty, faulty.steps["attention"][[1, 2, 3, 5]])
    np.testing.assert_array_equal(rollouts.healthy, healthy.steps["attention"][[1, 2, 3, 5]])


def test_seeds_where_actions_are_drawn(tmp_path: Path) -> None:
    run = make_run(tmp_path / "run", run_config("ppo-inner", **{"evaluate.greedy_actions": False}))
    one, same, other = (small(run, kinds=("blackout",), seed=seed) for seed in (1, 1, 2))
    assert one == same
    assert one.kinds != other.kinds
    for shift in one.kinds[0].robots:
        assert shift.effect_curve[:4] == (Estimate(0.0, 0.0, 0.0),) * 4
        assert shift.effect.mean.mean != 0.0


def test_even_attention_does_not_move(tmp_path: Path) -> None:
    found = small(make_run(tmp_path / "run", run_config("td-uniform")), kinds=SOME)
    assert found.attention == "uniform"
    assert found.effect.mean == Estimate(0.0, 0.0, 0.0)
    assert found.auc.mean == Estimate(0.5, 0.5, 0.5)
    assert {shift.p_value for kind in found.kinds for shift in kind.robots} == {1.0}


def test_a_masked_robot_gets_no_weight(tmp_path: Path) -> None:
    config = run_config("td-uniform", **{"network.mask_unavailable": True})
    found = small(make_run(tmp_path / "run", config), kinds=("unavailable",))
    for shift in found.kinds[0].robots:
        assert shift.after.mean == Estimate(0.0, 0.0, 0.0)
        assert shift.effect.mean.mean == pytest.approx(-1 / 3)
        assert shift.auc.mean == 0.0


def test_faults_of_training_are_left_out(tmp_path: Path) -> None:
    fault = {"robot": "food_0", "kind": "blackout", "value": 1.0, "onset_step": 2}
    late = fault | {"onset_step": 20}  # later than the episodes here are long
    config, healthy = (
        run_config("td-inner", **{"scenario.faults": faults}) for faults in ([fault, late], [])
    )
    assert config.scenario.faults
    one, other = (
        small(make_run(tmp_path / name, x), kinds=("motor_gain",))
        for name, x in (("one", config), ("other", healthy))
    )
    assert one == other


def test_what_cannot_be_asked(tmp_path: Path) -> None:
    run = make_run(tmp_path / "run", run_config("td-inner"))
    with pytest.raises(ValueError, match="smell"):
        small(run, kinds=("blackout", "smell"))
    with pytest.raises(ValueError, match="must be some of motor_gain"):
        small(run, kinds=())
    with pytest.raises(ValueError, match="episodes = 0"):
        small(run, episodes=0)
    with pytest.raises(ValueError, match="steps = 1"):
        small(run, steps=1)
    with pytest.raises(RunError, match="nowhere"):
        small(tmp_path / "nowhere")


def test_runs_without_a_choice_are_refused(tmp_path: Path) -> None:
    with pytest.raises(RunError, match="critic of mappo has no attention"):
        small(make_run(tmp_path / "mappo", run_config("mappo")))
    for robots in (1, 2):
        run = make_run(tmp_path / str(robots), config_of_team(robots))
        with pytest.raises(RunError, match=f"in a team of {robots}"):
            small(run)


def test_episodes_that_are_all_too_short_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = make_run(tmp_path / "run", run_config("td-inner"))
    record = played(run, None, 0)
    record.lengths[:] = 4
    monkeypatch.setattr("innerattn.evaluate.faults.attention.run_episodes", lambda *_, **__: record)
    with pytest.raises(RunError, match="until step 4"):
        small(run)
