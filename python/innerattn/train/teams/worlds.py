"""The worlds of a training for any team: several teams of a family, drawn anew as it goes on."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from innerattn.config import Scenario
from innerattn.config.family import Family
from innerattn.envs import BatchEnv
from innerattn.nn.teams import Relations, joined_tables, relate
from innerattn.policies import Policy, PolicyInput, WorldState, scripted_policy
from innerattn.train.teams.sheet import TeamSheet, as_tensor


class Outcome(NamedTuple):
    """What one control step of all worlds led to.

    Attributes:
        rewards: (B,) float32 the team's reward: rescues, and the shaping reward with its weight.
        rescues: (B,) float32 reward of rescues alone.
        terminated: (B,) bool.
        ended: (B,) bool, terminated or truncated.
    """

    rewards: Tensor
    rescues: Tensor
    terminated: Tensor
    ended: Tensor


class _Group:
    """Worlds of one team."""

    def __init__(self, scenario: Scenario, count: int, seed: int, script: str | None) -> None:
        self.env = BatchEnv(scenario, count, seed=seed, num_threads=1, copy=False)
        self.sheet = TeamSheet(scenario, self.env.observation_names())
        self.script: Policy | None = None if script is None else scripted_policy(script, scenario)
        self.obs = self.env.reset()


class TeamWorlds:
    """G teams in a number of worlds each, stepped as one batch of B.

    Attributes:
        groups: G.
    """

    def __init__(
        self,
        family: Family,
        base: Scenario,
        *,
        seed: int,
        groups: int,
        worlds_per_group: int,
        script: str | None,
    ) -> None:
        """Draw the first teams.

        Args:
            family: of the teams.
            base: what the family does not draw.
            seed: of teams and worlds.
            groups: G.
            worlds_per_group: worlds of each team.
            script: whose actions `wanted` gives; None: nobody's.
        """
        self.groups = groups
        self._family, self._seed, self._script = family, seed, script
        self._base = base.replace(rescue_credit="team")
        self._count = worlds_per_group
        self._drawn = 0
        self._choice = np.random.default_rng([seed, 1])
        names = BatchEnv.reward_component_names
        self._rescue, self._progress = names.index("rescue"), names.index("progress")
        self._worlds = [self._draw() for _ in range(groups)]

    @property
    def env_steps_per_step(self) -> int:
        """B."""
        return self.groups * self._count

    def redraw(self, count: int) -> None:
        """Replace ``count`` teams, chosen at random, by new ones."""
        for index in self._choice.choice(self.groups, count, replace=False):
            self._worlds[index].env.close()
            self._worlds[index] = self._draw()

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
        parts, at = [], 0
        for one in self._worlds:
            size = self._count * one.env.num_robots
            taken = actions[at : at + size].view(self._count, -1).numpy()
            at += size
            step = one.env.step(taken)
            one.obs = step.obs
            reward = one.env.reward_components()[:, 0]
            rescue = reward[:, self._rescue]
            whole = rescue + progress_weight * reward[:, self._progress]
            parts.append((whole, rescue.copy(), step.terminated, step.terminated | step.truncated))
        return Outcome(*(torch.from_numpy(np.concatenate(one)) for one in zip(*parts, strict=True)))

    def close(self) -> None:
        """Free all worlds."""
        for one in self._worlds:
            one.env.close()

    def _draw(self) -> _Group:
        number = self._drawn
        self._drawn += 1
        scenario = self._family.draw(self._seed, number, self._base)
        seed = int(np.random.SeedSequence([self._seed, 2, number]).generate_state(1)[0])
        return _Group(scenario, self._count, seed, self._script)
