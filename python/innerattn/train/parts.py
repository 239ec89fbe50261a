"""What the training of one team is made of, and its state as a whole."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import torch
from torch import Tensor

from innerattn.config import RunConfig
from innerattn.envs import BatchEnv
from innerattn.errors import ConfigError
from innerattn.learn.framed import unframed
from innerattn.learn.interruptions import Interruptions
from innerattn.learn.resume import Resumable, State, inside, take, under
from innerattn.learn.ring import Ring
from innerattn.learn.types import (
    Learner,
    RememberingLearner,
    ResumableLearner,
    SkippingLearner,
)
from innerattn.train.attention_log import AttentionLog
from innerattn.train.build import build_learner, team_of
from innerattn.train.checkpoint_info import Stage
from innerattn.train.collect import Collector, Tally
from innerattn.train.imitate import Imitation
from innerattn.train.memory import refuse_what_does_not_fit
from innerattn.train.metrics import Interval
from innerattn.train.potential import fitted_potential, unfitted_potential
from innerattn.train.schedule import Schedule
from innerattn.train.training import Training


class Parts(Training):
    """The parts of one training of one team.

    Attributes:
        env: its worlds.
        learner: what is trained.
        schedule: what changes over the run.
        collector: steps the learner in the worlds.
        imitation: the warm start, if there is one.
        attention: what the critic attended to of late.
    """

    def __init__(self, config: RunConfig, env: BatchEnv, stage: Stage) -> None:
        """Build everything that is needed from ``stage`` on.

        Raises:
            ConfigError: the configuration cannot be run here.
            MemoryError: a memory is too large.
        """
        self.config, self.env = config, env
        self.env_steps_at_once, self.robot_names = config.train.num_envs, env.robot_names
        self.learner: Learner = build_learner(config, env, training=True)
        self.schedule = Schedule(config, env, self.learner)
        device = torch.device(config.train.device)
        stagger = config.train.stagger_starts
        afterstates = config.algorithm.needs_afterstates
        self.collector = Collector(env, self.learner, device, self.schedule, stagger, afterstates)
        warm = stage == "imitating" and config.train.warm_start != "none"
        self.imitation = Imitation(config, env, self.learner, self.collector) if warm else None
        self.imitation_env_steps = None if self.imitation is None else self.imitation.env_steps
        refuse_what_does_not_fit(self.rings(stage), config)
        actions = team_of(config, env).actions
        self.attention = AttentionLog(
            env.robot_names, env.scenario.episode_steps, actions, config.train.device
        )
        self.interval = Interval()
        if config.train.on_divergence == "skip":
            within = unframed(self.learner)
            if not isinstance(within, SkippingLearner):
                raise ConfigError(
                    f"train.on_divergence = 'skip': method {config.train.method!r} cannot skip "
                    "updates; its learner has no attribute `skips_divergence`"
                )
            within.skips_divergence = True

    @property
    def resumable(self) -> ResumableLearner | None:
        """The learner, if its training can go on in another process."""
        able = isinstance(unframed(self.learner), ResumableLearner)
        return self.learner if able and isinstance(self.learner, ResumableLearner) else None

    @property
    def can_resume(self) -> bool:
        """See `Training.can_resume`."""
        return self.resumable is not None

    @property
    def updates(self) -> int:
        """See `Training.updates`."""
        return self.learner.updates

    def begin(self, interruptions: Interruptions) -> None:
        """Let the learner hear of interruptions, and a script's value shape rewards if asked for.

        The first line of metrics says how well the value fits.
        """
        if self.resumable is not None:
            self.resumable.interruptions = interruptions
        if self.config.train.potential != "none" and self.schedule.potential is None:
            potential, correlation = fitted_potential(self.config, self.env, interruptions.check)
            self.schedule.shape(potential)
            self.interval.add_losses({"potential_correlation": correlation})

    def imitate(self, share: float) -> Mapping[str, float]:
        """See `Training.imitate`; one control step."""
        assert self.imitation is not None  # parts were built for this stage
        newest, metrics = self.imitation.collect(share)
        self.attention.add(newest.obs, newest.actions)
        return metrics

    def learn_imitating(self, share: float) -> Mapping[str, float]:
        """See `Training.learn_imitating`."""
        assert self.imitation is not None
        return self.imitation.learn(share)

    def collect(self, share: float) -> Mapping[str, float]:
        """See `Training.collect`; one control step."""
        self.schedule.set_progress(share)
        transitions, truncated = self.collector.step()
        self.learner.observe(transitions, truncated)
        remembered = None
        if isinstance(self.learner, RememberingLearner):
            remembered = self.learner.remembered()
        self.attention.add(transitions.obs, transitions.actions, remembered)
        return {}

    def learn(self, share: float) -> Mapping[str, float]:
        """See `Training.learn`."""
        self.schedule.set_progress(share)
        self.learner.set_progress(share)
        return self.learner.learn() or {}

    def take_tally(self) -> Tally:
        """See `Training.take_tally`."""
        return self.collector.take_tally()

    def attention_entropy(self) -> dict[str, list[float]]:
        """See `Training.attention_entropy`."""
        return self.attention.entropy(self.learner)

    def weights(self) -> dict[str, Tensor]:
        """See `Training.weights`."""
        return self.learner.state()

    def compile(self) -> None:
        """See `Training.compile`."""
        self.learner.compile()

    def rings(self, stage: Stage) -> dict[str, Ring]:
        """See `Training.rings`."""
        rings = {} if self.resumable is None else under_rings("learner", self.resumable.rings())
        if stage == "imitating" and self.imitation is not None:
            rings |= under_rings("imitation", self.imitation.rings())
        return rings

    def resume_state(self, stage: Stage) -> dict[str, Tensor]:
        """See `Training.resume_state`."""
        worlds = np.frombuffer(self.env.snapshot(), np.uint8).copy()
        state = {"worlds": torch.from_numpy(worlds)}
        for name, part in self._parts(stage).items():
            state |= under(name, part.resume_state())
        if self.schedule.potential is not None:
            state |= under("potential", self.schedule.potential.resume_state())
        return state

    def load(self, weights: State, state: State, stage: Stage) -> None:
        """See `Training.load`."""
        self.learner.load(dict(weights))
        self.env.restore(take(state, "worlds", torch.uint8, None).numpy().tobytes())
        for name, part in self._parts(stage).items():
            try:
                part.load_resume_state(inside(name, state))
            except ValueError as error:
                raise ValueError(f"{name}: {error}") from error
        potential = inside("potential", state)
        if potential:
            found = unfitted_potential(self.config, self.env)
            found.load_resume_state(potential)
            self.schedule.shape(found)

    def _parts(self, stage: Stage) -> dict[str, Resumable]:
        parts: dict[str, Resumable] = {
            "collector": self.collector,
            "attention": self.attention,
            "interval": self.interval,
        }
        if self.resumable is not None:
            parts["learner"] = self.resumable
        if stage == "imitating" and self.imitation is not None:
            parts["imitation"] = self.imitation
        return parts


def under_rings(name: str, rings: dict[str, Ring]) -> dict[str, Ring]:
    """Rings with the name of their part before theirs."""
    return {f"{name}.{key}": ring for key, ring in rings.items()}
