"""The logged entropy is over a whole episode's steps, so that no phase of it shows."""

import math

import numpy as np
import pytest
import torch
from torch import Tensor

from innerattn.nn import DiscreteActions
from innerattn.train.attention_log import AttentionLog

ROBOTS, HEADS = 3, 2
NAMES = ("a", "b", "c")
DISCRETE = DiscreteActions(5)


class Phased:
    """Attention whose unevenness is the first column of an observation, 0 to 1."""

    def __init__(self) -> None:
        self.rows = 0

    def attention(self, obs: Tensor, actions: Tensor) -> Tensor:
        assert len(obs) == len(actions)
        self.rows = len(obs)
        share = 0.5 + obs[:, 0, 0] / 2.0  # of the first of two teammates
        weights = torch.zeros(len(obs), HEADS, ROBOTS, ROBOTS)
        for i in range(ROBOTS):
            first, second = (j for j in range(ROBOTS) if j != i)
            weights[:, :, i, first] = share[:, None]
            weights[:, :, i, second] = 1.0 - share[:, None]
        return weights


def plain(phase: float) -> float:
    p = 0.5 + phase / 2.0
    return -sum(x * math.log(x) for x in (p, 1.0 - p) if x > 0.0)


def add(log: AttentionLog, phase: float, worlds: int = 2) -> None:
    obs = torch.full((worlds, ROBOTS, 1), phase)
    log.add(obs, torch.zeros(worlds, ROBOTS, dtype=torch.int64))
    obs.fill_(math.nan)  # the worlds may use their memory again


@pytest.mark.parametrize("episode_steps", [1, 4, 50])
def test_the_entropy_is_the_mean_over_an_episode_in_whatever_phase(episode_steps: int) -> None:
    phases = [step / episode_steps for step in range(episode_steps)]
    expected = np.mean([plain(phase) for phase in phases])
    log, learner = AttentionLog(NAMES, episode_steps, DISCRETE), Phased()
    for step in range(3 * episode_steps):
        add(log, phases[step % episode_steps])
        if step + 1 >= episode_steps:
            found = log.entropy(learner)
            assert list(found) == list(NAMES)
            assert all(len(heads) == HEADS for heads in found.values())
            for heads in found.values():
                assert heads == pytest.approx([expected] * HEADS, abs=1e-6)


def test_what_there_is_counts_before_an_episode_is_over() -> None:
    log = AttentionLog(NAMES, 10, DISCRETE)
    add(log, 0.0)
    add(log, 1.0)
    assert log.entropy(Phased())["b"] == pytest.approx([plain(0.0) / 2.0] * HEADS, abs=1e-6)


def test_long_episodes_and_many_worlds_are_thinned_out() -> None:
    log, learner = AttentionLog(NAMES, 101, DISCRETE), Phased()
    for step in range(303):
        add(log, step % 101 / 101, worlds=70)
        found = log.entropy(learner)["a"][0]
    assert learner.rows == 34 * 64  # every third step of 64 worlds
    expected = np.mean([plain(step / 101) for step in range(101)])
    assert found == pytest.approx(expected, abs=0.02)


def test_a_critic_without_attention_has_no_entropy() -> None:
    class Without:
        def attention(self, *_: Tensor) -> None:
            return None

    log = AttentionLog(NAMES, 4, DISCRETE)
    add(log, 0.5)
    assert log.entropy(Without()) == {}


def test_it_goes_on_where_the_next_steps_lie() -> None:
    before = AttentionLog(NAMES, 4, DISCRETE)
    add(before, 0.5)
    log = AttentionLog(NAMES, 4, DISCRETE, "meta")  # holds shapes only, and is everywhere
    log.load_resume_state(before.resume_state())
    log.add(*(torch.zeros(2, ROBOTS, *more, device="meta") for more in ((1,), ())))
    state = log.resume_state()
    assert {name: state[name].device.type for name in ("obs", "actions")} == {
        "obs": "meta",
        "actions": "meta",
    }
    assert state["obs"].shape == (2, 2, ROBOTS, 1)
