"""The training of one policy for a family of teams."""

from __future__ import annotations

from collections.abc import Mapping

import torch
from torch import Tensor

from innerattn.config import RunConfig, Scenario
from innerattn.config.streams import stream_seed
from innerattn.config.team import TeamConfig
from innerattn.errors import ConfigError
from innerattn.learn import workers
from innerattn.learn.interruptions import Interruptions
from innerattn.learn.resume import Resumable, State, inside, under
from innerattn.learn.ring import Ring
from innerattn.learn.teams import TeamRollout, Weights
from innerattn.train.checkpoint_info import Stage
from innerattn.train.collect import Tally
from innerattn.train.metrics import Interval
from innerattn.train.teams.learner import build_team_learner, team_section
from innerattn.train.teams.sheet import SENSES
from innerattn.train.teams.worlds import TeamWorlds
from innerattn.train.training import Training


class TeamTraining(Training):
    """Rollouts of many teams, an update after each, and new teams as it goes on."""

    def __init__(self, config: RunConfig, stage: Stage) -> None:
        """Draw the first teams, and build the learner.

        Raises:
            ConfigError: the configuration asks for what this training does not have, or the family
                has no team that can do its tasks.
        """
        self.config, self.interval, self.robot_names = config, Interval(), ()
        self._team = team_section(config)
        _refuse_what_is_not_followed(config, self._team)
        steps = self._team.rollout_steps
        self.env_steps_at_once = config.train.num_envs * steps
        script = config.train.warm_start
        warm = stage == "imitating" and script != "none"
        self.imitation_env_steps = config.imitation.env_steps if warm else None
        seed = stream_seed(config.train.seed, "training")
        base = config.training_scenario.replace(rescue_credit="team")

        def draw(number: int) -> Scenario:
            family = config.family
            return base if family is None else family.draw(seed, number, base)

        self._worlds = TeamWorlds(
            draw,
            seed=seed,
            groups=self._team.teams,
            worlds_per_group=config.train.num_envs // self._team.teams,
            script=script if script != "none" else None,
            stagger_starts=config.train.stagger_starts,
        )
        self._learner = build_team_learner(config)
        self._rollout, self._after = TeamRollout(), self._worlds.relations()

    @property
    def updates(self) -> int:
        """See `Training.updates`."""
        return self._learner.updates

    @property
    def can_resume(self) -> bool:
        """See `Training.can_resume`."""
        return True

    def begin(self, interruptions: Interruptions) -> None:
        """See `Training.begin`; a rollout and its update are always done together."""
        del interruptions

    def imitate(self, share: float) -> Mapping[str, float]:
        """See `Training.imitate`; one rollout."""
        del share
        # Robots are measured by their likeliest actions. By these they may wait for each other for
        # ever, which by drawn ones they hardly ever do: half of the worlds show such states.
        count = workers.share_of(self.config.train.num_envs)
        every_other = (torch.arange(count) + workers.rank() * count) % 2 == 0
        self._collect(self._progress_weight(0.0), imitates=True, greedy=every_other)
        return {}

    def learn_imitating(self, share: float) -> Mapping[str, float]:
        """See `Training.learn_imitating`; one pass over the rollout."""
        rates = self.config.imitation
        rate = _falling(rates.learning_rate, rates.final_learning_rate_share, share)
        return self._update(Weights(rate, imitation=1.0, policy=0.0, entropy=0.0))

    def collect(self, share: float) -> Mapping[str, float]:
        """See `Training.collect`; one rollout."""
        self._collect(self._progress_weight(share), imitates=self._pull(share) > 0.0)
        return {}

    def learn(self, share: float) -> Mapping[str, float]:
        """See `Training.learn`; one pass over the rollout."""
        ramp = self.config.train.schedule.entropy_weight
        entropy = self._team.entropy_weight if ramp is None else ramp.at(share)
        rate = _falling(self._team.learning_rate, self._team.final_learning_rate_share, share)
        return self._update(Weights(rate, self._pull(share), policy=1.0, entropy=entropy))

    def take_tally(self) -> Tally:
        """See `Training.take_tally`."""
        return self._worlds.take_tally()

    def attention_entropy(self) -> dict[str, list[float]]:
        """See `Training.attention_entropy`; robots have no names here."""
        return {}

    def weights(self) -> dict[str, Tensor]:
        """See `Training.weights`."""
        return self._learner.state()

    def compile(self) -> None:
        """See `Training.compile`; sizes differ from batch to batch, so nothing is compiled."""

    def rings(self, stage: Stage) -> dict[str, Ring]:
        """See `Training.rings`; there are none."""
        del stage
        return {}

    def resume_state(self, stage: Stage) -> dict[str, Tensor]:
        """See `Training.resume_state`; between two rollouts."""
        del stage
        state: dict[str, Tensor] = {}
        for name, part in self._parts().items():
            state |= under(name, part.resume_state())
        return state

    def load(self, weights: State, state: State, stage: Stage) -> None:
        """See `Training.load`."""
        del stage
        self._learner.load(weights)
        for name, part in self._parts().items():
            try:
                part.load_resume_state(inside(name, state))
            except ValueError as error:
                raise ValueError(f"{name}: {error}") from error
        self._after = self._worlds.relations()

    def close(self) -> None:
        """Free the worlds."""
        self._worlds.close()

    def _parts(self) -> dict[str, Resumable]:
        return {"worlds": self._worlds, "learner": self._learner, "interval": self.interval}

    def _progress_weight(self, share: float) -> float:
        ramp = self.config.train.schedule.dense_weight
        return 1.0 if ramp is None else ramp.at(share)

    def _pull(self, share: float) -> float:
        """Weight of the script's actions while learning from rewards."""
        return self._team.pull * (1.0 - share)

    def _collect(
        self, progress_weight: float, *, imitates: bool, greedy: bool | Tensor = False
    ) -> None:
        rollout, seen = TeamRollout(), self._after
        for _ in range(self._team.rollout_steps):
            actions, log_probs = self._learner.act(seen, greedy=greedy)
            rollout.seen.append(seen)
            rollout.actions.append(actions)
            rollout.log_probs.append(log_probs)
            if imitates:
                rollout.wanted.append(self._worlds.wanted())
            outcome = self._worlds.step(actions, progress_weight)
            rollout.rewards.append(outcome.rewards)
            rollout.terminated.append(outcome.terminated)
            rollout.ended.append(outcome.ended)
            following = torch.zeros_like(outcome.rewards)
            if outcome.cut_seen is not None:
                following[outcome.cut] = self._learner.values(outcome.cut_seen)
            rollout.following.append(following)
            seen = self._worlds.relations()
        self._rollout, self._after = rollout, seen

    def _update(self, weights: Weights) -> Mapping[str, float]:
        found = self._learner.learn(self._rollout, self._after, self._worlds.groups, weights)
        self._rollout = TeamRollout()
        if self._team.new_teams:
            self._worlds.redraw(self._team.new_teams)
            self._after = self._worlds.relations()
        return found


def _falling(first: float, last_share: float, share: float) -> float:
    return first * (1.0 - (1.0 - last_share) * share)


def _refuse_what_is_not_followed(config: RunConfig, team: TeamConfig) -> None:
    train = config.train
    if train.num_envs % team.teams:
        raise ConfigError(
            f"train.num_envs = {train.num_envs}: must be a multiple of team.teams = {team.teams}"
        )
    if team.new_teams > team.teams:
        raise ConfigError(
            f"team.new_teams = {team.new_teams}: must be in 0..={team.teams}, team.teams"
        )
    refused = {
        "train.device": train.device == "cpu",
        "train.potential": train.potential == "none",
        "train.schedule.gamma": train.schedule.gamma is None,
        "train.on_divergence": train.on_divergence == "stop",
    }
    for key, is_fine in refused.items():
        if not is_fine:
            raise ConfigError(f"{key}: method {train.method!r} cannot follow it; leave it out")
    if team.pull and train.warm_start == "none":
        raise ConfigError(
            f"team.pull = {team.pull:g}: needs a script to follow, train.warm_start; or must be 0"
        )
    for fault in config.training_scenario.faults:
        if fault.kind in SENSES:
            raise ConfigError(
                f"scenario.faults: method {train.method!r} cannot be trained with {fault.kind!r}, "
                "with which robots see different things; it acts with it"
            )
    if config.scenario.actions != "discrete":
        raise ConfigError(
            f"scenario.actions = 'continuous': method {train.method!r} needs 'discrete'"
        )
