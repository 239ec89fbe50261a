"""What a run weighs differently in its course, against rewards counted by hand."""

from contextlib import closing

import numpy as np
import pytest
import torch
from pydantic import ValidationError

from innerattn.config import RunConfig, Scenario
from innerattn.config.schedule import Ramp, ScheduleConfig
from innerattn.envs import BatchEnv
from innerattn.errors import ConfigError
from innerattn.learn.types import Learner
from innerattn.policies import PolicyInput, WorldState, scripted_policy
from innerattn.train.build import build_learner
from innerattn.train.collect import Collector
from innerattn.train.schedule import Schedule

RAMPS = {
    "dense_weight": {"first": 0.5, "last": 0.0, "end": 0.5},
    "team_credit": {"first": 0.0, "last": 1.0, "begin": 0.25, "end": 0.75},
    "gamma": {"first": 0.9, "last": 0.98},
    "entropy_weight": {"first": 0.02, "last": 0.002},
}


def test_ramps_go_linearly_from_first_to_last() -> None:
    ramp = Ramp(first=1.0, last=3.0, begin=0.2, end=0.6)
    shares = (0.0, 0.2, 0.3, 0.4, 0.6, 1.0)
    assert [ramp.at(share) for share in shares] == pytest.approx([1.0, 1.0, 1.5, 2.0, 3.0, 3.0])
    step = Ramp(first=1.0, last=0.0, begin=0.5, end=0.5)
    assert [step.at(share) for share in (0.0, 0.49, 0.5, 1.0)] == [1.0, 1.0, 0.0, 0.0]


@pytest.mark.parametrize(
    ("ramps", "message"),
    [
        (
            {"gamma": {"first": 0.9, "last": 1.1}},
            "gamma: first = 0.9 and last = 1.1",
        ),
        ({"team_credit": {"first": 2.0, "last": 0.0}}, "team_credit: first = 2.0"),
        ({"dense_weight": {"first": -1.0, "last": 0.0}}, "greater than or equal to 0"),
        ({"gamma": {"first": 0.9, "last": 0.9, "begin": 0.5, "end": 0.4}}, "begin = 0.5: must be"),
        ({"gamma": {"first": 0.9}}, "last"),
        ({"reward": {"first": 0.9, "last": 1.0}}, "reward"),
    ],
)
def test_ramps_that_make_no_sense_are_refused(ramps: dict[str, object], message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        ScheduleConfig.model_validate(ramps)


def test_a_scheduled_discount_does_not_go_with_potential_shaping() -> None:
    with pytest.raises(ValidationError, match=r"train\.schedule\.gamma: potential shaping"):
        RunConfig.model_validate(
            {
                "scenario": {"shaping": "potential"},
                "train": {"schedule": {"gamma": RAMPS["gamma"]}},
            }
        )


def test_only_a_schedule_changes_the_digest() -> None:
    scheduled = RunConfig.model_validate({"train": {"schedule": RAMPS}})
    assert scheduled.digest() != RunConfig().digest()
    assert RunConfig.model_validate({"train": {"schedule": {}}}).digest() == RunConfig().digest()


def config(method: str, schedule: object, **scenario: object) -> RunConfig:
    return RunConfig.model_validate(
        {
            "scenario": Scenario.preset("double").replace(**scenario),
            "network": {"hidden_width": 8},
            "td": {"replay_capacity": 2_000, "warmup_env_steps": 100_000},
            "train": {"method": method, "threads": 1, "schedule": schedule},
        }
    )


@pytest.mark.parametrize("credit", ["helpers", "team"])
def test_rewards_are_weighed_as_the_schedule_says(credit: str) -> None:
    run = config(
        "mappo", RAMPS, rescue_credit=credit, rescue_reward=2.0, contact_cost=0.1, action_cost=0.01
    )
    rescues = 0
    with (
        closing(BatchEnv(run.scenario, 20, seed=5, num_threads=1)) as env,
        closing(BatchEnv(run.scenario, 20, seed=5, num_threads=1)) as other,
    ):
        learner = build_learner(run, env)
        schedule = Schedule(run, env, learner)
        script = scripted_policy("hungarian", run.scenario)

        class Hungarian:
            def act(self, obs: torch.Tensor) -> torch.Tensor:
                view = PolicyInput(obs.numpy(), WorldState.of(env))
                return torch.from_numpy(script.act(view))

        collector = Collector(env, Hungarian(), torch.device("cpu"), schedule)  # type: ignore[arg-type]
        other.reset()
        for number in range(40):
            share = number / 40
            schedule.set_progress(share)
            got, _ = collector.step()
            step = other.step(got.actions.numpy())
            components = other.reward_components()
            expected = components[..., 1] * weight_at(share, "dense_weight")
            expected = expected + components[..., 2:].sum(-1)
            team = weight_at(share, "team_credit")
            for event in step.rescues:
                rescues += 1
                expected[event["env"]] += 2.0 * team
                for helper in (event["helper_0"], event["helper_1"]):
                    expected[event["env"], helper] += 2.0 * (1.0 - team)
            np.testing.assert_allclose(got.reward, expected, atol=1e-6)
            assert got.reward_parts is not None
            assert got.reward_parts.shape == (20, 4, 4)
    assert rescues > 20


def weight_at(share: float, name: str) -> float:
    return Ramp.model_validate(RAMPS[name]).at(share)


def test_without_ramps_rewards_are_the_worlds_own() -> None:
    run = config("mappo", {})
    with closing(BatchEnv(run.scenario, 3, seed=5, num_threads=1)) as env:
        learner = build_learner(run, env)
        collector = Collector(env, learner, torch.device("cpu"), Schedule(run, env, learner))
        transitions, _ = collector.step()
        assert transitions.reward_parts is None


def test_td_weighs_what_it_remembers_anew() -> None:
    run = config("td-inner", RAMPS)
    with closing(BatchEnv(run.scenario, 50, seed=5, num_threads=1)) as env:
        learner = build_learner(run, env)
        schedule = Schedule(run, env, learner)
        collector = Collector(env, learner, torch.device("cpu"), schedule)
        seen = []
        for _ in range(20):
            transitions, truncated = collector.step()
            learner.observe(transitions, truncated)
            seen.append(transitions.reward_parts)
    parts = torch.cat(seen).double()
    for share in (0.0, 0.6, 1.0):
        schedule.set_progress(share)
        team, dense = weight_at(share, "team_credit"), weight_at(share, "dense_weight")
        weights = torch.tensor([1.0 - team, team, dense, 1.0], dtype=torch.float64)
        rewards = parts @ weights.float().double()
        torch.testing.assert_close(learner.replay.reward_mean, rewards.mean(0))  # type: ignore[attr-defined]


def test_a_learner_that_follows_no_schedule_is_refused() -> None:
    class Other:
        """Lacks `follow`."""

    run = config("mappo", RAMPS)
    other: Learner = Other()  # type: ignore[assignment]
    with (
        closing(BatchEnv(run.scenario, 1, num_threads=1)) as env,
        pytest.raises(ConfigError, match=r"train\.schedule: method 'mappo' cannot follow one"),
    ):
        Schedule(run, env, other)


def test_staggered_worlds_end_their_episodes_at_all_times() -> None:
    run = config("mappo", {}, episode_steps=10)
    with closing(BatchEnv(run.scenario, 30, seed=5, num_threads=1)) as env:
        learner = build_learner(run, env)
        collector = Collector(env, learner, torch.device("cpu"), stagger_starts=True)
        ends = torch.stack([collector.step()[1] for _ in range(10)])
    assert ends.sum(0).tolist() == [1] * 30
    assert ends.sum(1).tolist() == [3] * 10
