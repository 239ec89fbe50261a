"""What a training is made of, built from its configuration, and its state as a whole."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from innerattn.config import RunConfig
from innerattn.envs import BatchEnv
from innerattn.errors import ConfigError
from innerattn.learn.framed import unframed
from innerattn.learn.resume import Resumable, State, inside, take, under
from innerattn.learn.ring import Ring
from innerattn.learn.types import Learner, ResumableLearner, SkippingLearner
from innerattn.train.attention_log import AttentionLog
from innerattn.train.build import build_learner, team_of
from innerattn.train.checkpoint_info import Stage
from innerattn.train.collect import Collector
from innerattn.train.imitate import Imitation
from innerattn.train.memory import refuse_what_does_not_fit
from innerattn.train.metrics import Interval
from innerattn.train.potential import unfitted_potential
from innerattn.train.schedule import Schedule


class Parts:
    """The parts of one training.

    Attributes:
        config: the run.
        env: its worlds.
        learner: what is trained.
        schedule: what changes over the run.
        collector: steps the learner in the worlds.
        imitation: the warm start, if there is one.
        attention: what the critic attended to of late.
        interval: counts since the last line of metrics.
    """

    def __init__(self, config: RunConfig, env: BatchEnv, stage: Stage) -> None:
        """Build everything that is needed from ``stage`` on.

        Raises:
            ConfigError: the configuration cannot be run here.
            MemoryError: a memory is too large.
        """
        self.config, self.env = config, env
        self.learner: Learner = build_learner(config, env, training=True)
        self.schedule = Schedule(config, env, self.learner)
        device = torch.device(config.train.device)
        stagger = config.train.stagger_starts
        afterstates = config.algorithm.needs_afterstates
        self.collector = Collector(env, self.learner, device, self.schedule, stagger, afterstates)
        warm = stage == "imitating" and config.train.warm_start != "none"
        self.imitation = Imitation(config, env, self.learner, self.collector) if warm else None
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

    def rings(self, stage: Stage) -> dict[str, Ring]:
        """The large memories that are needed from ``stage`` on, by name."""
        rings = {} if self.resumable is None else under_rings("learner", self.resumable.rings())
        if stage == "imitating" and self.imitation is not None:
            rings |= under_rings("imitation", self.imitation.rings())
        return rings

    def resume_state(self, stage: Stage) -> dict[str, Tensor]:
        """All else that is needed to go on in ``stage``, by name; see `Resumable`."""
        worlds = np.frombuffer(self.env.snapshot(), np.uint8).copy()
        state = {"worlds": torch.from_numpy(worlds)}
        for name, part in self._parts(stage).items():
            state |= under(name, part.resume_state())
        if self.schedule.potential is not None:
            state |= under("potential", self.schedule.potential.resume_state())
        return state

    def load(self, weights: State, state: State, stage: Stage) -> None:
        """Go on from a state, once the rings are filled.

        Raises:
            ValueError: it is none of an equal run in this stage.
        """
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
