"""Robustness bounds of small networks and of runs: what must stay, stays; a check can fail."""

import json
from dataclasses import asdict
from itertools import product
from pathlib import Path

import numpy as np
import pytest
import torch
from fresh_run import config_of_team, make_run, run_config
from plain_critic import D, W, generator, make_actor, make_critic, make_states

from innerattn.errors import RunError
from innerattn.evaluate.bounds import disturb, inequalities
from innerattn.evaluate.bounds import measure as bounds
from innerattn.evaluate.bounds.measure import bounds_of_run, measure_bounds, played_states
from innerattn.evaluate.bounds.perturbation import random_directions, rms_norm
from innerattn.evaluate.bounds.results import Bounds
from innerattn.nn import Critic, JointCritic, UniformAttention
from innerattn.train import load_policy


def measured(robots: int = 3, seed: int = 0, critic: Critic | JointCritic | None = None) -> Bounds:
    critic = make_critic(robots) if critic is None else critic
    return measure_bounds(critic, make_actor(robots), make_states(robots), seed)


def test_all_levels_hold() -> None:
    found = measured()
    assert found.violations == 0
    assert (found.attention, len(found.levels)) == ("inner", 5 * len(bounds.RADII))
    for level in found.levels:
        assert level.checks
        for name, check in level.checks.items():
            assert check.checks > 0
            assert 0 < check.median_tightness <= check.largest_tightness <= 1 + 1e-6, name
            assert check.median_change <= check.largest_change
        assert (level.own is None) == (level.actor_flips is None) == (level.changed == "embedding")
        assert (level.teammates is None) == (level.direction == "gradient_own")
    by_kind = {(x.changed, x.direction, x.radius): x.checks for x in found.levels}
    for changed, radius in product(["embedding", "observation"], bounds.RADII):
        drawn, climbed = (by_kind[changed, kind, radius] for kind in ("random", "gradient"))
        for figure in ("median_change", "largest_change", "median_tightness"):
            assert getattr(climbed["logit"], figure) >= getattr(drawn["logit"], figure)


@pytest.mark.parametrize(
    ("function", "share", "sure", "possible"),
    [
        ("head_norms", 0.3, {"logit", "own_logit"}, {"weight_by_norms"}),
        ("largest_weight_change", 0.9, {"weight", "own_row_sharp"}, {"own_row", "weight_by_norms"}),
    ],
)
def test_bounds_that_are_too_small_are_found_violated(
    monkeypatch: pytest.MonkeyPatch,
    function: str,
    share: float,
    sure: set[str],
    possible: set[str],
) -> None:
    right = getattr(inequalities, function)
    monkeypatch.setattr(inequalities, function, lambda *given: share * right(*given))
    found = measured()
    broken = {
        name for level in found.levels for name, check in level.checks.items() if check.violations
    }
    assert sure <= broken <= sure | possible
    assert found.violations > 0


def test_even_attention_does_not_move() -> None:
    found = measured(critic=make_critic(3, UniformAttention))
    assert (found.attention, found.query_norms, found.key_norms) == ("uniform", (), ())
    assert {level.direction for level in found.levels} == {"random"}
    assert {level.changed for level in found.levels} == {"embedding", "observation"}
    for level in found.levels:
        assert level.checks == {}
        assert level.largest_weight_change == 0.0
        assert level.teammates is not None
        assert level.teammates.median > 0.0


def test_without_attention_only_values_move() -> None:
    found = measured(critic=JointCritic(3, D, 1, W, generator(0)).double())
    assert (found.attention, found.embedding_norms) == ("none", ())
    assert len(found.levels) == len(bounds.RADII)
    for level in found.levels:
        assert (level.changed, level.direction, level.checks) == ("observation", "random", {})
        assert level.largest_weight_change is None
        assert level.teammates is not None
        assert level.own is not None
        assert level.teammates.flips is level.own.flips is None
        assert level.teammates.largest > 0.0
        assert level.actor_flips is not None


def test_a_value_head_has_no_greedy_action() -> None:
    found = measured(critic=make_critic(3, outputs=1))
    assert found.violations == 0
    assert all(x.teammates is None or x.teammates.flips is None for x in found.levels)


def test_two_robots_have_logits_but_no_choice() -> None:
    found = measured(robots=2)
    assert found.violations == 0
    for level in found.levels:
        assert level.largest_weight_change in (None, 0.0)
        for name in level.checks.keys() & {"logit", "own_logit"}:
            assert level.checks[name].largest_change > 0.0
        for name in level.checks.keys() & {"weight", "own_row", "own_row_sharp"}:
            assert level.checks[name].largest_change == 0.0


def test_one_robot_is_refused() -> None:
    with pytest.raises(ValueError, match="1 robot"):
        measured(robots=1)


def test_seeds_parts_and_what_is_left_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bounds, "RADII", (0.1, 1.0))
    critic = make_critic(3).float()
    weights = {name: value.clone() for name, value in critic.state_dict().items()}
    calls: list[tuple[int, int]] = []
    states = make_states(3, masked=True)
    one = measure_bounds(
        critic, make_actor(3), states, 5, lambda done, total: calls.append((done, total))
    )
    assert calls == [(k + 1, len(one.levels)) for k in range(len(one.levels))]
    for name, value in critic.state_dict().items():
        assert value.dtype == torch.float32
        assert torch.equal(value, weights[name])
    assert measure_bounds(critic, make_actor(3), states, 5) == one
    other = measure_bounds(critic, make_actor(3), states, 6)
    assert other.levels != one.levels
    monkeypatch.setattr(disturb, "_ROWS_AT_ONCE", 1)
    parts = measure_bounds(critic, make_actor(3), states, 5)
    for level, same in zip(parts.levels, one.levels, strict=True):
        assert level.checks["logit" if "logit" in level.checks else "own_logit"].checks == (
            same.checks["logit" if "logit" in same.checks else "own_logit"].checks
        )
        np.testing.assert_allclose(numbers(level), numbers(same), rtol=1e-6, atol=1e-12)


def numbers(level: object) -> list[float]:
    """All numbers of nested plain values, in order."""
    values = level if isinstance(level, dict) else asdict(level)
    flat: list[float] = []
    for value in values.values():
        if isinstance(value, dict):
            flat += numbers(value)
        elif isinstance(value, int | float):
            flat.append(value)
    return flat


def test_sizes_are_relative_to_what_is_changed() -> None:
    x = torch.tensor([[[3.0, 4.0], [0.0, 5.0]], [[1.0, 0.0], [0.0, 7.0]]])
    torch.testing.assert_close(rms_norm(x), torch.tensor([5.0, 5.0]))
    units = random_directions((3, 4, 5), generator(0))
    torch.testing.assert_close(units.norm(dim=2), torch.ones(3, 4, dtype=torch.float64))
    found = measured(critic=JointCritic(3, D, 1, W, generator(0)))
    expected = rms_norm(make_states(3).obs).tolist()
    assert list(found.observation_norms) == pytest.approx(expected)


@pytest.mark.parametrize(
    ("method", "attention"),
    [("td-inner", "inner"), ("ppo-inner", "inner"), ("td-uniform", "uniform"), ("mappo", "none")],
)
def test_a_run(
    method: str, attention: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bounds, "RADII", (0.1, 1.0))
    run = make_run(tmp_path / "run", run_config(method))
    found = bounds_of_run(run, states=2)
    assert (found.attention, found.violations, found.states) == (attention, 0, 2)
    assert found.seed == run_config(method).evaluate.seed
    document = found.to_json()
    assert json.loads(json.dumps(document, allow_nan=False)) == json.loads(json.dumps(document))
    assert document["schema_version"] == 2
    assert document["violations"] == 0
    assert len(document["levels"]) == len(found.levels)


def test_states_are_those_of_the_runs_own_play(tmp_path: Path) -> None:
    config, learner = load_policy(make_run(tmp_path / "run", run_config("td-inner")))
    states = played_states(config, learner, 30, seed=3)
    assert states.obs.shape[:2] == states.actions.shape == (4, 30)
    assert states.obs.dtype == torch.float64
    assert states.available is None
    greedy = learner.act(states.obs.transpose(0, 1).float(), greedy=True)
    assert torch.equal(states.actions, greedy.t())
    assert len(torch.unique(states.obs[0], dim=0)) == 30
    again, other = (played_states(config, learner, 30, seed=seed) for seed in (3, 4))
    assert torch.equal(again.obs, states.obs)
    assert not torch.equal(other.obs, states.obs)


def test_masked_attention(tmp_path: Path) -> None:
    config = run_config("td-inner", **{"network.mask_unavailable": True})
    run = make_run(tmp_path / "run", config)
    states = played_states(*load_policy(run), 5, seed=3)
    assert states.available is not None
    assert states.available.shape == (5, 4)
    assert states.available.all()
    assert bounds_of_run(run, states=3).violations == 0


def test_a_team_of_one_is_refused(tmp_path: Path) -> None:
    run = make_run(tmp_path / "run", config_of_team(1))
    with pytest.raises(RunError, match="one robot"):
        bounds_of_run(run)


def test_continuous_actions_are_refused(tmp_path: Path) -> None:
    run = make_run(tmp_path / "run", run_config("ppo-inner", **{"scenario.actions": "continuous"}))
    with pytest.raises(RunError, match=r"scenario\.actions = 'continuous'"):
        bounds_of_run(run)
