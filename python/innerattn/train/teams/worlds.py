"""The worlds of a training for any team: several teams of a family, drawn anew as it goes on."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from innerattn.config import Scenario
from innerattn.envs import BatchEnv, MixedBatchEnv
from innerattn.learn import workers
from innerattn.learn.resume import State, take, take_within
from innerattn.nn.teams import Relations, joined_tables, relate
from innerattn.policies import Policy, PolicyInput, WorldState, scripted_policy
from innerattn.train.collect import Tally, staggered
from innerattn.train.teams.sheet import TeamSheet, as_tensor

_MOST = 2**62


class Outcome(NamedTuple):
    """What one control step of all worlds led to.

    Attributes:
        rewards: (B,) float32 the team's reward, with a weight of the part for coming nearer.
        terminated: (B,) bool.
        ended: (B,) bool, terminated or truncated.
        cut: (C,) int64, worlds that a time limit ended.
        cut_seen: the last state of those; None where there are none.
    """

    rewards: Tensor
    terminated: Tensor
    ended: Tensor
    cut: Tensor
    cut_seen: Relations | None


class _Group:
    """Worlds of one team."""

    def __init__(
        self,
        number: int,
        scenario: Scenario,
        count: int,
        seed: int,
        script: str | None,
        stagger: bool,
    ) -> None:
        self.number = number
        self.env = BatchEnv(scenario, count, seed=seed, num_threads=1, copy=False)
        self.open_rescues = np.zeros(count, np.int64)
        self.sheet = TeamSheet(scenario, self.env.observation_names())
        self.script: Policy | None = None if script is None else scripted_policy(script, scenario)
        self.obs = self.env.reset() if not stagger else staggered(self.env)


class TeamWorlds:
    """G teams in a number of worlds each, stepped as one batch of B.

    Several workers have a share of the teams each. Together they have the teams, and the worlds,
    that one alone would have.

    Attributes:
        groups: G, of this worker.
    """

    def __init__(
        self,
        draw: Callable[[int], Scenario],
        *,
        seed: int,
        groups: int,
        worlds_per_group: int,
        script: str | None,
        stagger_starts: bool = False,
    ) -> None:
        """Draw the first teams.

        Args:
            draw: gives team 0, 1, 2 and so on.
            seed: of the worlds, and of which teams are replaced.
            groups: teams of all workers.
            worlds_per_group: worlds of each team.
            script: whose actions `wanted` gives; None: nobody's.
            stagger_starts: let worlds of a team be at different steps of their episodes.
        """
        self.groups, self._of_all = workers.share_of(groups), groups
        self._first = workers.rank() * self.groups
        self._scenario, self._seed, self._script = draw, seed, script
        self._count, self._stagger = worlds_per_group, stagger_starts
        self._drawn, self._redrawn = groups, 0
        self._counts = np.zeros(5, np.int64)  # as `Tally`
        self._progress = BatchEnv.reward_component_names.index("progress")
        self._worlds = [self._group(self._first + number) for number in range(self.groups)]
        self._env = MixedBatchEnv([one.env for one in self._worlds], num_threads=1)

    def redraw(self, count: int) -> None:
        """Replace ``count`` teams of all workers, chosen at random, by new ones."""
        choice = np.random.default_rng([self._seed, 1, self._redrawn])
        self._redrawn += 1
        replaced = choice.choice(self._of_all, count, replace=False) - self._first
        for number, index in enumerate(replaced.tolist(), start=self._drawn):
            if 0 <= index < self.groups:
                self._worlds[index] = new = self._group(number)
                self._env.replace(index, new.env)
        self._drawn += count

    def relations(self) -> Relations:
        """What is to be seen now."""
        return relate(joined_tables([one.sheet.tables(as_tensor(one.obs)) for one in self._worlds]))

    def wanted(self) -> Tensor:
        """What the script would do now, (N,) int64."""
        found = []
        for one in self._worlds:
            assert one.script is not None
            found.append(one.script.act(PolicyInput(one.obs, WorldState.of(one.env))).reshape(-1))
        return torch.from_numpy(np.concatenate(found).astype(np.int64))

    def step(self, actions: Tensor, progress_weight: float) -> Outcome:
        """One control step of all worlds.

        Args:
            actions: (N,) int64, world by world.
            progress_weight: of the reward for coming nearer.
        """
        parts, last = [], []
        steps = self._env.step_batches(actions.numpy())
        for one, step in zip(self._worlds, steps, strict=True):
            one.obs = step.obs
            reward = one.env.reward_components().mean(1)
            whole_reward = reward.sum(1) + (progress_weight - 1.0) * reward[:, self._progress]
            ended = step.terminated | step.truncated
            np.add.at(one.open_rescues, step.rescues["env"], 1)
            over, rescues = int(ended.sum()), int(one.open_rescues[ended].sum())
            lost = len(one.env.lost()) if one.env.scenario.has_deadlines else 0
            self._counts += (over, rescues, over, len(step.rescues), lost)
            one.open_rescues[ended] = 0
            cut = step.truncated & ~step.terminated
            parts.append((whole_reward, step.terminated, ended, cut))
            if cut.any():
                last.append(one.sheet.tables(as_tensor(step.final_obs[cut])))
        rewards, terminated, ended, cut = map(np.concatenate, zip(*parts, strict=True))
        return Outcome(
            rewards=torch.from_numpy(rewards),
            terminated=torch.from_numpy(terminated),
            ended=torch.from_numpy(ended),
            cut=torch.from_numpy(cut.nonzero()[0]),
            cut_seen=relate(joined_tables(last)) if last else None,
        )

    def take_tally(self) -> Tally:
        """Counts since the last call, of all workers."""
        mortal = sum(one.env.scenario.has_deadlines for one in self._worlds)
        *counts, mortal = workers.total(torch.tensor([*self._counts, mortal])).tolist()
        self._counts[[0, 1, 3, 4]] = 0
        return Tally(*counts) if mortal else Tally(*counts[:4])

    def resume_state(self) -> dict[str, Tensor]:
        """Which teams there are, and their worlds; see `Resumable`."""
        images = [np.frombuffer(one.env.snapshot(), np.uint8) for one in self._worlds]
        return {
            "drawn": torch.tensor([self._drawn, self._redrawn]),
            "teams": torch.tensor([one.number for one in self._worlds]),
            "open_rescues": torch.from_numpy(np.stack([one.open_rescues for one in self._worlds])),
            "tally": torch.from_numpy(self._counts.copy()),
            "lengths": torch.tensor([len(image) for image in images]),
            "worlds": torch.from_numpy(np.concatenate(images)),
        }

    def load_resume_state(self, state: State) -> None:
        """Go on from a state; see `Resumable`."""
        count = self.groups
        drawn = take_within(state, "drawn", torch.int64, 0, _MOST, 2).tolist()
        teams = take_within(state, "teams", torch.int64, 0, max(0, drawn[0] - 1), count).tolist()
        open_rescues = take_within(
            state, "open_rescues", torch.int64, 0, _MOST, count, self._count
        ).numpy()
        self._counts = take_within(state, "tally", torch.int64, 0, _MOST, 5).numpy().copy()
        lengths = take_within(state, "lengths", torch.int64, 0, _MOST, count).tolist()
        images = take(state, "worlds", torch.uint8, None).numpy()
        if sum(lengths) != len(images):
            raise ValueError(f"'worlds' has {len(images)} bytes: must have {sum(lengths)}")
        self._env.close()
        ends = np.cumsum(lengths)
        self._worlds = []
        for number, length, end, rescues in zip(teams, lengths, ends, open_rescues, strict=True):
            self._worlds.append(self._group(number))
            self._worlds[-1].env.restore(images[end - length : end].tobytes())
            self._worlds[-1].obs = self._worlds[-1].env.observe()
            self._worlds[-1].open_rescues = rescues.copy()
        self._env = MixedBatchEnv([one.env for one in self._worlds], num_threads=1)
        self._drawn, self._redrawn = drawn

    def close(self) -> None:
        """Free all worlds."""
        self._env.close()

    def _group(self, number: int) -> _Group:
        seed = int(np.random.SeedSequence([self._seed, 2, number]).generate_state(1)[0])
        scenario = self._scenario(number)
        return _Group(number, scenario, self._count, seed, self._script, self._stagger)
