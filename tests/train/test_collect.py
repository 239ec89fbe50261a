"""The collector against a plain loop over a second, equal batch of worlds."""

import numpy as np
import pytest
import torch
from torch import Tensor

from innerattn.config import Scenario
from innerattn.envs import BatchEnv
from innerattn.policies import PolicyInput, WorldState, scripted_policy
from innerattn.train.collect import Collector


class Scripted:
    """Acts by script, so that rescues happen; of a learner it has only what collecting needs."""

    def __init__(self, env: BatchEnv) -> None:
        self.env = env
        self.policy = scripted_policy("hungarian", env.scenario)
        self.seen: list[Tensor] = []

    def act(self, obs: Tensor, greedy: bool = False) -> Tensor:
        assert not greedy  # training explores
        self.seen.append(obs)
        env = self.env
        view = PolicyInput(obs.numpy(), WorldState.of(env))
        return torch.from_numpy(self.policy.act(view))


def test_transitions_and_counts_against_a_plain_loop() -> None:
    scenario = Scenario.preset("double").replace(episode_steps=15)
    env, other = (BatchEnv(scenario, 5, seed=3, num_threads=1) for _ in range(2))
    learner = Scripted(env)
    collector = Collector(env, learner, torch.device("cpu"))
    obs = other.reset().copy()
    episodes = rescues = all_rescues = 0
    open_rescues = [0] * 5
    for step_index in range(50):
        transitions, truncated = collector.step()
        step = other.step(transitions.actions.numpy())
        np.testing.assert_array_equal(transitions.obs, obs)
        np.testing.assert_array_equal(transitions.next_obs, step.final_obs)
        np.testing.assert_array_equal(transitions.reward, step.reward)
        np.testing.assert_array_equal(transitions.terminated, step.terminated)
        np.testing.assert_array_equal(truncated, step.truncated)
        assert transitions.actions.dtype == torch.int64
        obs = step.obs.copy()
        for event in step.rescues:
            open_rescues[event["env"]] += 1
            all_rescues += 1
        for e in range(5):
            if step.truncated[e]:
                episodes += 1
                rescues += open_rescues[e]
                open_rescues[e] = 0
        if step_index == 20:
            tally = collector.take_tally()
            assert (tally.episodes, tally.rescues) == (episodes, rescues)
            assert (tally.episodes, tally.all_rescues) == (5, all_rescues)
            episodes = rescues = all_rescues = 0
    tally = collector.take_tally()
    assert (tally.episodes, tally.rescues, tally.total_episodes) == (episodes, rescues, 15)
    assert tally.all_rescues == all_rescues > 0


def test_losses_are_counted_where_victims_can_be_lost() -> None:
    plain = Scenario.preset("double")
    mortal = plain.replace(tasks=tuple(task.replace(deadline_s=1.0) for task in plain.tasks))
    env, other = (BatchEnv(mortal, 5, seed=3, num_threads=1) for _ in range(2))
    collector = Collector(env, Scripted(env), torch.device("cpu"))
    other.reset()
    lost = 0
    for _ in range(40):
        transitions, _ = collector.step()
        other.step(transitions.actions.numpy())
        lost += len(other.lost())
    state = collector.resume_state()
    assert collector.take_tally().all_lost == lost > 0
    assert collector.take_tally().all_lost == 0
    collector.load_resume_state(state)
    assert collector.take_tally().all_lost == lost
    collector.load_resume_state({**state, "tally": state["tally"][:4]})  # of an older version
    assert collector.take_tally().all_lost == 0
    endless = BatchEnv(plain, 5, seed=3, num_threads=1)
    others = Collector(endless, Scripted(endless), torch.device("cpu"))
    assert others.take_tally().all_lost is None
    with pytest.raises(ValueError, match="'tally' has 5 numbers: must have 4"):
        others.load_resume_state({**others.resume_state(), "tally": state["tally"]})


def test_victims_that_are_turned_away_are_counted() -> None:
    plain = Scenario.preset("double")
    tasks = tuple(task.replace(arrival_rate_hz=6.0) for task in plain.tasks)
    worlds = plain.replace(situation="poisson", max_victims=1, tasks=tasks)
    env, other = (BatchEnv(worlds, 5, seed=3, num_threads=1) for _ in range(2))
    collector = Collector(env, Scripted(env), torch.device("cpu"))
    other.reset()
    turned_away = 0
    for _ in range(40):
        transitions, _ = collector.step()
        other.step(transitions.actions.numpy())
        turned_away += int(other.turned_away().sum())
    state = collector.resume_state()
    tally = collector.take_tally()
    assert tally.all_turned_away == turned_away > 0
    assert tally.all_lost is None
    assert collector.take_tally().all_turned_away == 0
    collector.load_resume_state(state)
    assert collector.take_tally().all_turned_away == turned_away


def test_transitions_stay_when_the_worlds_go_on() -> None:
    env = BatchEnv("mixed", 3, seed=0, num_threads=1)
    collector = Collector(env, Scripted(env), torch.device("cpu"))
    first, _ = collector.step()
    copy = [tensor.clone() for tensor in first[:5]]
    for _ in range(5):
        collector.step()
    assert all(torch.equal(a, b) for a, b in zip(first[:5], copy, strict=True))
