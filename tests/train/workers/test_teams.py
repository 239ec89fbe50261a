"""Workers that learn one policy for any team have the worlds of one, and learn what it learns."""

from typing import NamedTuple

import numpy as np
import pytest
import torch
from random_teams import Size, random_tables
from torch import Tensor
from worker_threads import Together

from innerattn.config import Scenario, load_run_config
from innerattn.config.family import Family
from innerattn.errors import ConfigError
from innerattn.learn.teams import TeamLearner, TeamRollout, Weights
from innerattn.nn.teams import joined_tables, relate
from innerattn.train.teams.worlds import TeamWorlds

pytestmark = pytest.mark.timeout(120)

STEPS = 4
SIZES = (Size(worlds=4, robots=3), Size(worlds=4, robots=5, victims=2))
ROBOTS = (12, 20)
WEIGHTS = Weights(learning_rate=3e-3, imitation=0.4, policy=1.0, entropy=0.01)


class Numbers(NamedTuple):
    """What happened in a step: of robots, then of worlds."""

    actions: Tensor
    wanted: Tensor
    log_probs: Tensor
    rewards: Tensor
    ended: Tensor
    following: Tensor


def learner() -> TeamLearner:
    return TeamLearner(
        width=8, pooling="inner", key_width=4, gamma=0.9, gae_lambda=0.7, clip=0.2, seed=3
    )


def numbers(step: int) -> Numbers:
    draw = torch.Generator().manual_seed(step)
    robots, worlds = sum(ROBOTS), sum(size.worlds for size in SIZES)
    ended = torch.rand(worlds, generator=draw) < 0.3
    return Numbers(
        torch.randint(5, (robots,), generator=draw),
        torch.randint(5, (robots,), generator=draw),
        -1.6 + 0.2 * torch.randn(robots, generator=draw),
        torch.rand(worlds, generator=draw),
        ended,
        torch.randn(worlds, generator=draw) * ended,
    )


def learnt(groups: tuple[int, ...], one: TeamLearner) -> tuple[dict[str, Tensor], dict[str, float]]:
    """What a learner comes to from the worlds of some teams, after two rollouts."""
    robots = torch.tensor([group in groups for group in (0, 1) for _ in range(ROBOTS[group])])
    worlds = torch.tensor([group in groups for group in (0, 1) for _ in range(4)])
    found: dict[str, float] = {}
    for first in (0, 50):
        steps = TeamRollout()
        seen = [
            relate(joined_tables([random_tables(SIZES[k], 10 * step + k) for k in groups]))
            for step in range(first, first + STEPS + 1)
        ]
        steps.seen += seen[:-1]
        for step in range(first, first + STEPS):
            all_of = numbers(step)
            steps.actions.append(all_of.actions[robots])
            steps.wanted.append(all_of.wanted[robots])
            steps.log_probs.append(all_of.log_probs[robots])
            steps.rewards.append(all_of.rewards[worlds])
            steps.ended.append(all_of.ended[worlds])
            steps.terminated.append(torch.zeros(int(worlds.sum()), dtype=torch.bool))
            steps.following.append(all_of.following[worlds])
        found = one.learn(steps, seen[-1], len(groups), WEIGHTS)
    return one.state(), found


def test_two_learn_what_one_learns_from_all_worlds(together: Together) -> None:
    state, found = learnt((0, 1), learner())
    both = learner(), learner()  # which draw from one generator of the process
    results = together(2, lambda rank: learnt((rank,), both[rank]))
    for own, metrics in results:
        for name, value in own.items():
            assert torch.equal(value, results[0][0][name])  # all workers have the same bits
            torch.testing.assert_close(value, state[name], atol=2e-5, rtol=2e-4)
        assert metrics == results[0][1]
        assert metrics == pytest.approx(found, rel=1e-4, abs=1e-6)
    assert set(found) == {"agreement", "entropy", "kl", "critic_loss"}
    alone, _ = learnt((0,), learner())
    assert float((alone["actor.first.weight"] - state["actor.first.weight"]).abs().max()) > 1e-3


def team_worlds() -> TeamWorlds:
    family, base = Family(robots=(2, 5)), Scenario(episode_steps=6, engine="discs")
    return TeamWorlds(
        lambda number: family.draw(1, number, base),
        seed=1,
        groups=4,
        worlds_per_group=3,
        script="greedy",
        stagger_starts=True,
    )


def played(worlds: TeamWorlds) -> tuple[list[list[np.ndarray]], list[int]]:
    """What each team sees, step by step; the number of each, and the counts at the end."""
    seen: list[list[np.ndarray]] = []
    for step in range(14):
        worlds.step(worlds.wanted(), 0.3)
        if step % 4 == 3:
            worlds.redraw(3)
        seen.append([np.asarray(one.obs).copy() for one in worlds._worlds])
    tally = worlds.take_tally()
    worlds.close()
    return seen, [tally.episodes, tally.rescues, tally.total_episodes, tally.all_rescues]


def test_two_have_the_worlds_of_one(together: Together) -> None:
    seen, tally = played(team_worlds())
    halves = together(2, lambda _: played(team_worlds()))
    for step, teams in enumerate(seen):
        both = [*halves[0][0][step], *halves[1][0][step]]
        assert len(both) == len(teams) == 4
        assert all(np.array_equal(a, b) for a, b in zip(both, teams, strict=True))
    assert tally[0] > 5
    assert tally == halves[0][1] == halves[1][1]


def test_workers_must_divide_the_teams() -> None:
    values = {"train.workers": 3, "train.num_envs": 48, "team.teams": 16}
    with pytest.raises(ConfigError, match=r"train.workers = 3: must divide team.teams = 16"):
        load_run_config(method="team-inner", family="any", overrides=values)
