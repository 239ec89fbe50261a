"""Worlds of several teams as one batch."""

from collections.abc import Iterator
from contextlib import closing, contextmanager

import numpy as np
import torch

from innerattn.config import Scenario
from innerattn.config.family import Family
from innerattn.envs import BatchEnv
from innerattn.nn.teams import joined_tables, relate
from innerattn.policies import PolicyInput, WorldState, scripted_policy
from innerattn.train.teams.sheet import TeamSheet
from innerattn.train.teams.worlds import TeamWorlds

BASE = Scenario(episode_steps=12, engine="discs")
FAMILY = Family(robots=(2, 5))


@contextmanager
def team_worlds(seed: int = 1) -> Iterator[TeamWorlds]:
    worlds = TeamWorlds(
        lambda number: FAMILY.draw(seed, number, BASE),
        seed=seed,
        groups=3,
        worlds_per_group=4,
        script="hungarian",
    )
    yield worlds
    worlds.close()


def played(worlds: TeamWorlds, steps: int) -> list[torch.Tensor]:
    found = []
    for _ in range(steps):
        outcome = worlds.step(worlds.wanted(), 0.3)
        found += [*outcome[:4], *(outcome.cut_seen or ()), *worlds.relations()]
    return found


def world_seed(number: int) -> int:
    return int(np.random.SeedSequence([1, 2, number]).generate_state(1)[0])


def test_each_team_is_as_if_it_were_alone() -> None:
    with team_worlds() as worlds:
        envs = [one.env for one in worlds._worlds]
        alone = [
            BatchEnv(env.scenario, 4, seed=world_seed(number), num_threads=1)
            for number, env in enumerate(envs)
        ]
        scripts = [scripted_policy("hungarian", env.scenario) for env in envs]
        for env in alone:
            env.reset()
        rescues = cuts = 0
        for _ in range(15):  # past the end of an episode
            outcome = worlds.step(worlds.wanted(), 0.5)
            rewards, ended, last = [], [], []
            for env, script in zip(alone, scripts, strict=True):
                step = env.step(script.act(PolicyInput(env.observe(), WorldState.of(env))))
                names = env.reward_component_names
                parts = torch.from_numpy(env.reward_components().mean(1))
                rewards.append(parts.sum(1) - 0.5 * parts[:, names.index("progress")])
                rescues += len(step.rescues)
                ended.append(torch.from_numpy(step.truncated | step.terminated))
                cut = step.truncated & ~step.terminated
                if cut.any():
                    sheet = TeamSheet(env.scenario, env.observation_names())
                    last.append(sheet.tables(torch.from_numpy(step.final_obs[cut])))
            torch.testing.assert_close(outcome.rewards, torch.cat(rewards), atol=1e-6, rtol=1e-6)
            assert torch.equal(outcome.ended, torch.cat(ended))
            assert (outcome.cut_seen is None) == (not last)
            if outcome.cut_seen is not None:
                assert torch.equal(
                    outcome.cut, (outcome.ended & ~outcome.terminated).nonzero()[:, 0]
                )
                for one, other in zip(outcome.cut_seen, relate(joined_tables(last)), strict=True):
                    assert torch.equal(one, other)
                cuts += 1
        tally = worlds.take_tally()
        assert tally.all_rescues == rescues > 0
        assert cuts == 1
        assert tally.episodes == 3 * 4  # of 12 steps


def test_equal_seeds_give_equal_teams_and_worlds() -> None:
    runs = []
    for seed in (1, 1, 2):
        with team_worlds(seed) as worlds:
            first = played(worlds, 3)
            worlds.redraw(2)
            runs.append((first, [one.env.scenario for one in worlds._worlds], played(worlds, 3)))
    assert runs[0][1] == runs[1][1]
    assert all(
        torch.equal(a, b)
        for one, other in ((runs[0][0], runs[1][0]), (runs[0][2], runs[1][2]))
        for a, b in zip(one, other, strict=True)
    )
    assert runs[0][1] != runs[2][1]


def test_losses_are_counted_where_victims_can_be_lost() -> None:
    plain = Scenario.preset("double").replace(engine="discs")
    mortal = plain.replace(tasks=tuple(task.replace(deadline_s=1.0) for task in plain.tasks))
    tallies = []
    for scenario in (mortal, plain):
        worlds = TeamWorlds(
            lambda _, scenario=scenario: scenario,  # type: ignore[misc]
            seed=1,
            groups=2,
            worlds_per_group=4,
            script=None,
        )
        twins = [BatchEnv(scenario, 4, seed=world_seed(k), num_threads=1) for k in (0, 1)]
        still = np.zeros((4, 4), np.int64)
        lost = 0
        with closing(worlds):
            for twin in twins:
                twin.reset()
            for _ in range(30):
                worlds.step(torch.zeros(32, dtype=torch.int64), 1.0)
                for twin in twins:
                    twin.step(still)
                    lost += len(twin.lost())
            tallies.append((worlds.take_tally().all_lost, lost))
            assert worlds.take_tally().all_lost == (0 if scenario is mortal else None)
    assert tallies[0][0] == tallies[0][1] > 0
    assert tallies[1][0] is None


def test_redrawing_replaces_so_many_teams() -> None:
    with team_worlds() as worlds:
        before = [one.env.scenario for one in worlds._worlds]
        worlds.redraw(2)
        after = [one.env.scenario for one in worlds._worlds]
    assert sum(one != other for one, other in zip(before, after, strict=True)) == 2
