"""The policy of any team, acting for one team on its observations."""

from __future__ import annotations

import torch
from torch import Tensor

from innerattn.config import RunConfig
from innerattn.envs import BatchEnv
from innerattn.learn.types import Transitions
from innerattn.nn.teams import TeamActor, relate
from innerattn.train.teams.learner import build_team_learner
from innerattn.train.teams.sheet import TeamSheet

_TABLES_AT_ONCE = 2_048


class TeamPolicy:
    """A `Learner` that acts; `innerattn.train.teams.training.TeamTraining` trains it.

    Attributes:
        actor_frozen: as of `Learner`; it never learns.
        updates: as of `Learner`.
    """

    actor_frozen = True
    updates = 0

    def __init__(self, config: RunConfig, env: BatchEnv) -> None:
        """Initial weights, for the team in ``env``.

        Raises:
            ConfigError: actions are continuous.
        """
        self._learner = build_team_learner(config)
        self._sheet = TeamSheet(env.scenario, env.observation_names())
        self._own_sheet = TeamSheet(env.scenario, env.observation_names(), each_sees=True)

    def act(self, obs: Tensor, greedy: bool = False) -> Tensor:
        """See `Learner.act`."""
        worlds, robots, _ = obs.shape
        views = robots if self._sheet.each_sees else 1
        found = []
        for part in torch.split(obs, max(1, _TABLES_AT_ONCE // views)):
            actions, _ = self._learner.act(relate(self._sheet.tables(part)), greedy=greedy)
            found.append(self._sheet.own_rows(actions))
        return torch.cat(found).view(worlds, robots)

    def let_each_see(self) -> None:
        """Let each robot act on its own row from now on: senses may fail, whatever faults say."""
        self._sheet = self._own_sheet

    @property
    def num_robots(self) -> int:
        """R."""
        return self._sheet.num_robots

    @property
    def actor(self) -> TeamActor:
        """Its network."""
        return self._learner.actor

    @torch.no_grad()
    def own_log_probs(self, obs: Tensor) -> Tensor:
        """Log-probabilities (E, R, 5) where each robot looks at its own row of ``obs`` (E, R, D).

        `act` lets one table of a world serve all its robots while no sense can fail. Numbers then
        differ by rounding, and the order of victims may differ that a robot reaches at once.
        """
        worlds, robots, _ = obs.shape
        found = []
        for part in torch.split(obs, max(1, _TABLES_AT_ONCE // robots)):
            seen = relate(self._own_sheet.tables(part))
            found.append(self._own_sheet.own_rows(self.actor(seen)))
        return torch.cat(found).view(worlds, robots, -1)

    def seed_draws(self, seed: int) -> None:
        """See `Learner.seed_draws`."""
        self._learner.seed_draws(seed)

    def attention(self, obs: Tensor, actions: Tensor) -> Tensor | None:
        """See `Learner.attention`; the critic has none, the actor's is over victims and robots."""
        del obs, actions
        return None

    def state(self) -> dict[str, Tensor]:
        """See `Learner.state`."""
        return self._learner.state()

    def load(self, state: dict[str, Tensor]) -> None:
        """See `Learner.load`."""
        self._learner.load(state)

    def set_progress(self, share: float) -> None:
        """See `Learner.set_progress`; nothing changes."""

    def compile(self) -> None:
        """See `Learner.compile`; there is no update."""

    def observe(self, batch: Transitions, truncated: Tensor) -> None:
        """Never called: a family of teams is not one batch of transitions."""
        raise NotImplementedError

    def imitate(self, obs: Tensor, actions: Tensor, learning_rate: float) -> float:
        """Never called; see `observe`."""
        raise NotImplementedError

    def learn(self) -> dict[str, float] | None:
        """Never called; see `observe`."""
        raise NotImplementedError
