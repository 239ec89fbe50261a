"""Builds the learner of any team that a configuration names."""

from __future__ import annotations

import numpy as np
from torch import nn

from innerattn.config import RunConfig
from innerattn.config.team import TeamConfig
from innerattn.learn import workers
from innerattn.learn.teams import TeamLearner
from innerattn.nn.teams import TeamActor, TeamCritic


def team_section(config: RunConfig) -> TeamConfig:
    """The section of a run whose method is of any team."""
    assert isinstance(config.algorithm, TeamConfig)
    return config.algorithm


def build_team_learner(config: RunConfig) -> TeamLearner:
    """A learner with initial weights, seeded by `train.seed`; workers draw actions of their own."""
    team, seeds = team_section(config), np.random.SeedSequence([config.train.seed, 3])
    learner = TeamLearner(
        width=team.hidden_width,
        pooling=team.pooling,
        key_width=team.key_width,
        features=team.features,
        bodies=team.bodies,
        gamma=team.gamma,
        gae_lambda=team.gae_lambda,
        clip=team.clip,
        seed=_number(seeds),
    )
    learner.seed_draws(_number(workers.own_seed(seeds)))
    return learner


def _number(seeds: np.random.SeedSequence) -> int:
    return int(seeds.generate_state(1)[0])


def team_networks(team: TeamConfig) -> tuple[nn.Module, ...]:
    """Its networks, with weights drawn from torch's global generator."""
    return TeamActor(team.hidden_width, team.pooling, team.key_width), TeamCritic()
