"""Records against a plain loop, and the promise that policies meet the same starts."""

from contextlib import closing
from dataclasses import fields

import numpy as np
import pytest
from numpy.typing import NDArray

from innerattn.config import RunConfig, Scenario
from innerattn.envs import BatchEnv
from innerattn.evaluate import play as episodes
from innerattn.evaluate.play import run_episodes
from innerattn.evaluate.trained import TrainedPolicy
from innerattn.learn.types import RememberingLearner
from innerattn.policies import PolicyInput, WorldState, scripted_policy
from innerattn.records.record import FIELDS, Record
from innerattn.train.build import build_learner

SEED = 12_345


def record_of(name: str, scenario: Scenario, count: int, **options: object) -> Record:
    return run_episodes(scripted_policy(name, scenario), scenario, count, SEED, **options)


def assert_equal(one: Record, other: Record) -> None:
    for field in fields(Record):
        a, b = getattr(one, field.name), getattr(other, field.name)
        if field.name == "steps":
            assert a.keys() == b.keys()
            for name in a:
                np.testing.assert_array_equal(a[name], b[name], strict=True)
        elif isinstance(a, np.ndarray):
            np.testing.assert_array_equal(a, b, strict=True)
        else:
            assert a == b


def test_record_against_a_plain_loop() -> None:
    scenario = Scenario.preset("double").replace(episode_steps=12)
    record = record_of("hungarian", scenario, 6, record=FIELDS)
    assert list(record.steps) == [
        name
        for name in FIELDS
        if name
        not in ("headings", "charge", "load", "heard", "rays", "attention", "actor_attention")
    ]
    policy = scripted_policy("hungarian", scenario)
    env = BatchEnv(scenario, 6, seed=SEED, copy=True)
    obs = env.reset()
    events = []
    total = np.zeros((6, 4, len(env.reward_component_names)))
    for t in range(12):
        state = WorldState.of(env)
        actions = policy.act(PolicyInput(obs, state))
        seen = {"obs": obs, **state._asdict(), "actions": actions}
        for name in seen.keys() & record.steps.keys():
            value = seen[name]
            np.testing.assert_array_equal(record.steps[name][:, t], value)
        step = env.step(actions)
        np.testing.assert_array_equal(record.steps["rewards"][:, t].sum(-1), step.reward)
        total += env.reward_components()
        events += [
            tuple(int(event[n]) for n in record.rescues.dtype.names[1:]) for event in step.rescues
        ]
        obs = step.obs
    assert sorted(tuple(map(int, event))[1:] for event in record.rescues) == sorted(events)
    assert len(events) > 6
    np.testing.assert_allclose(record.rewards_total, total)
    np.testing.assert_array_equal(record.lengths, 12)
    assert record.reward_names[0] == "rescue"
    # Every rescue is worth one to each of its helpers.
    assert record.rewards_total[..., 0].sum() == 2 * len(record.rescues)


def test_rescue_counts_by_hand() -> None:
    record = record_of("hungarian", Scenario.preset("double"), 5, first_episode=3)
    expected = [sum(event["episode"] == 3 + e for event in record.rescues) for e in range(5)]
    np.testing.assert_array_equal(record.rescue_counts(), expected)
    assert sum(expected) == len(record.rescues) > 0
    order = record.rescues[["episode", "step"]].tolist()
    assert order == sorted(order)


def test_policies_meet_the_same_starts() -> None:
    scenario = Scenario.preset("mixed")
    records = [record_of(name, scenario, 8, record=FIELDS) for name in ("random", "hungarian")]
    for name in ("obs", "positions", "victims"):
        one, other = (record.steps[name] for record in records)
        np.testing.assert_array_equal(one[:, 0], other[:, 0])
        assert not np.array_equal(one[:, -1], other[:, -1])


def test_batches_make_no_difference(monkeypatch: pytest.MonkeyPatch) -> None:
    scenario = Scenario.preset("mixed")
    whole = record_of("hungarian", scenario, 10, record=("positions", "victims"))
    monkeypatch.setattr(episodes, "_WORLDS_AT_ONCE", 4)
    done: list[int] = []
    parts = record_of(
        "hungarian", scenario, 10, record=("positions", "victims"), progress=done.append
    )
    assert_equal(whole, parts)
    assert done == [4, 4, 2]
    later = record_of("hungarian", scenario, 3, first_episode=7)
    np.testing.assert_array_equal(later.rescue_counts(), whole.rescue_counts()[7:])


class Recalling:
    """A policy whose actions depend on how often it acted since it forgot."""

    name, needs_true_state = "recalling", False
    steps = 7

    def act(self, view: PolicyInput) -> NDArray[np.int64]:
        self.steps += 1
        return np.full(view.obs.shape[:2], self.steps % 5)

    def reset(self, seed: int) -> None: ...

    def forget(self) -> None:
        self.steps = 0


def test_policies_forget_before_each_batch(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(episodes, "_WORLDS_AT_ONCE", 2)
    record = run_episodes(Recalling(), Scenario.preset("mixed"), 4, 0, record=("actions",))
    steps = np.arange(1, record.lengths.max() + 1) % 5
    for actions in record.steps["actions"]:
        np.testing.assert_array_equal(actions, np.tile(steps[:, None], (1, actions.shape[1])))


def test_a_trained_team_forgets_at_a_reset() -> None:
    scenario = Scenario.preset("mixed")
    values = {"network": {"memory_width": 8, "hidden_width": 16}, "train": {"method": "ppo-inner"}}
    with closing(BatchEnv(scenario, 3, num_threads=1)) as env:
        learner = build_learner(RunConfig.model_validate(values), env)
        obs = env.reset()
    assert isinstance(learner, RememberingLearner)
    policy = TrainedPolicy(learner, "ppo-inner")
    policy.reset(1)
    first = policy.act(PolicyInput(obs))
    for _ in range(2):
        policy.act(PolicyInput(obs))
    assert learner.remembered().abs().max() > 0
    policy.reset(1)
    np.testing.assert_array_equal(policy.act(PolicyInput(obs)), first)
    assert learner.remembered().abs().max() == 0


def test_an_episode_that_ends_early_counts_no_further() -> None:
    scenario = Scenario.preset("double").replace(end_when_rescued=2, episode_steps=40)
    record = record_of("hungarian", scenario, 12, record=("positions", "rewards"))
    counts = record.rescue_counts()
    assert np.all((counts == 2) | (counts == 3))  # two may happen in one step
    for e, length in enumerate(record.lengths):
        last = record.rescues[record.rescues["episode"] == e]["step"].max()
        assert length == last + 1 < 40
        assert np.all(record.steps["positions"][e, length:] == 0)
        assert np.any(record.steps["positions"][e, length - 1] != 0)
        np.testing.assert_allclose(
            record.steps["rewards"][e].sum(0), record.rewards_total[e], atol=1e-5
        )


@pytest.mark.parametrize("episodes", [0, -1])
def test_no_episodes_are_refused(episodes: int) -> None:
    with pytest.raises(ValueError, match=f"episodes = {episodes}: must be at least 1"):
        record_of("random", Scenario.preset("mixed"), episodes)


def test_unknown_fields_are_refused() -> None:
    with pytest.raises(ValueError, match="'smell'"):
        record_of("random", Scenario.preset("mixed"), 1, record=("smell",))


class Watching:
    """Stays, and keeps what it was shown."""

    name = "watching"

    def __init__(self, needs_true_state: bool) -> None:
        self.needs_true_state = needs_true_state
        self.seen: list[PolicyInput] = []
        self.seeds: list[int] = []

    def act(self, view: PolicyInput) -> np.ndarray:
        self.seen.append(view)
        return np.zeros(view.obs.shape[:2], np.int64)

    def reset(self, seed: int) -> None:
        self.seeds.append(seed)


@pytest.mark.parametrize("needs", [True, False])
def test_the_true_state_is_fetched_only_where_it_is_needed(
    needs: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    scenario, fetched = Scenario(episode_steps=3), []
    whole = WorldState.of

    def counted(env: BatchEnv) -> WorldState:
        fetched.append(env)
        return whole(env)

    monkeypatch.setattr(WorldState, "of", counted)
    policy = Watching(needs)
    run_episodes(policy, scenario, 2, 0)
    assert len(fetched) == (3 if needs else 0)
    assert all((view.state is not None) == needs for view in policy.seen)
    record = run_episodes(policy, scenario, 2, 0, record=("positions",))
    assert len(fetched) == (6 if needs else 3)  # to be recorded
    assert all((view.state is not None) == needs for view in policy.seen)
    assert record.steps["positions"].shape == (2, 3, 4, 2)


def test_a_policy_is_reset_before_it_plays_and_draws_the_same_again() -> None:
    policy = Watching(False)
    run_episodes(policy, Scenario(episode_steps=1), 2, SEED)
    run_episodes(policy, Scenario(episode_steps=1), 2, SEED, first_episode=2)
    assert policy.seeds[0] == SEED
    assert policy.seeds[1] not in (SEED, SEED + 2)
    drawing = scripted_policy("random", Scenario(), 3)
    first, second, other = (
        run_episodes(drawing, Scenario(episode_steps=4), 3, seed, record=("actions",))
        for seed in (0, 0, 1)
    )
    assert (first.steps["actions"] == second.steps["actions"]).all()
    assert (first.steps["actions"] != other.steps["actions"]).any()


def test_a_script_without_the_true_state_says_so() -> None:
    with pytest.raises(ValueError, match="state = None"):
        scripted_policy("greedy", Scenario()).act(PolicyInput(np.zeros((1, 4, 44), np.float32)))
