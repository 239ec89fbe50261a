"""A learner that sees every observation turned, and whose actions are turned back.

It stands between the worlds and any learner, which never learns of it. With frames of observations
the policy and all values are exactly equivariant. With random elements the learner trains on turned
worlds instead, which only teaches it the symmetry.
"""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from innerattn.learn import workers
from innerattn.learn.interruptions import Interruptions
from innerattn.learn.resume import State, inside, take_generator, under
from innerattn.learn.ring import Ring
from innerattn.learn.types import (
    ActorAttention,
    Afterstates,
    Learner,
    RememberingLearner,
    ResumableLearner,
    Transitions,
)
from innerattn.nn import NUM_ELEMENTS, SquareSymmetry


def unframed(learner: Learner) -> Learner:
    """The learner inside its frames, if it has any."""
    return learner.learner if isinstance(learner, FramedLearner) else learner


def as_seen(learner: Learner, obs: Tensor, actions: Tensor) -> tuple[Tensor, Tensor]:
    """Observations (B, R, D) and actions (B, R) as a policy's networks have them when it plays."""
    if isinstance(learner, FramedLearner):
        return learner.as_seen(obs, actions)
    return obs, actions


class FramedLearner:
    """A learner in frames that observations choose themselves, or that are drawn.

    Attributes:
        learner: The learner inside, whose observations and actions are turned.
    """

    def __init__(
        self,
        learner: Learner,
        symmetry: SquareSymmetry,
        drawn: int | None,
        states: SquareSymmetry | None = None,
    ) -> None:
        """Wrap a learner.

        Args:
            learner: The learner inside.
            symmetry: The group for its observations.
            drawn: Seed of the elements that are drawn in training, one for each world and control
                step; None: every observation has its own frame.
            states: The group for states of worlds, each of which has its own frame; None: they stay
                as they are.
        """
        self.learner = learner
        self._symmetry, self._states = symmetry, states
        self._generator = None if drawn is None else torch.Generator().manual_seed(_own(drawn))
        self._acted: tuple[Tensor, Tensor, Tensor] | None = None

    @property
    def actor_frozen(self) -> bool:
        """Whether `learn` leaves the policy as it is; see `Learner`."""
        return self.learner.actor_frozen

    @actor_frozen.setter
    def actor_frozen(self, frozen: bool) -> None:
        self.learner.actor_frozen = frozen

    @property
    def updates(self) -> int:
        """Number of updates done so far."""
        return self.learner.updates

    def act(self, obs: Tensor, greedy: bool = False) -> Tensor:
        """Choose actions (E, R) int64 for observations (E, R, D); see `Learner.act`."""
        element, seen = self._look(obs)
        self._acted = (obs, element, seen)
        if isinstance(self.learner, RememberingLearner):
            actions = self.learner.act(seen, greedy, element)
        else:
            actions = self.learner.act(seen, greedy)
        return self._symmetry.turn_actions_back(actions, element)

    def observe(self, batch: Transitions, truncated: Tensor) -> None:
        """Store one control step of E worlds; see `Learner.observe`."""
        if self._acted is not None and self._acted[0] is batch.obs:
            _, element, seen = self._acted
        else:
            element, seen = self._look(batch.obs)
        after = element if self._generator is not None else self._symmetry.frame(batch.next_obs)
        turned = batch._replace(
            obs=seen,
            actions=self._symmetry.turn_actions(batch.actions, element),
            next_obs=self._symmetry.turn(batch.next_obs, after),
            afterstates=self._turned(batch.afterstates),
            elements=element,
            next_elements=after,
        )
        self.learner.observe(turned, truncated)

    def _turned(self, afterstates: Afterstates | None) -> Afterstates | None:
        if afterstates is None or self._states is None:
            return afterstates
        states = afterstates.states
        return afterstates._replace(states=self._states.turn(states, self._states.frame(states)))

    def imitate(self, obs: Tensor, actions: Tensor, learning_rate: float) -> float:
        """Train the policy to take given actions; see `Learner.imitate`."""
        element, seen = self._look(obs)
        turned = self._symmetry.turn_actions(actions, element)
        return self.learner.imitate(seen, turned, learning_rate)

    def attention(
        self, obs: Tensor, actions: Tensor, remembered: Tensor | None = None
    ) -> Tensor | None:
        """Attention weights (B, H, R, R) of the critic; see `RememberingLearner.attention`.

        Elements that are drawn in training are left out.
        """
        element = None
        if self._generator is None:
            element, obs = self._look(obs)
            actions = self._symmetry.turn_actions(actions, element)
        if isinstance(self.learner, RememberingLearner):
            return self.learner.attention(obs, actions, remembered, element)
        return self.learner.attention(obs, actions)

    def actor_attention(self, obs: Tensor) -> Tensor | None:
        """Attention weights (B, H, R, R) of the actor; see `ActorAttention`.

        Elements that are drawn in training are left out.
        """
        if not isinstance(self.learner, ActorAttention):
            return None
        seen = obs if self._generator is not None else self._look(obs)[1]
        return self.learner.actor_attention(seen)

    def forget(self) -> None:
        """Begin new episodes in all worlds; see `RememberingLearner`."""
        if isinstance(self.learner, RememberingLearner):
            self.learner.forget()

    def remembered(self) -> Tensor | None:
        """What robots remembered before they acted last; see `RememberingLearner`."""
        if isinstance(self.learner, RememberingLearner):
            return self.learner.remembered()
        return None

    def as_seen(self, obs: Tensor, actions: Tensor) -> tuple[Tensor, Tensor]:
        """Observations (B, R, D) and actions (B, R) as the learner inside has them when it plays.

        Elements that are drawn in training are left out.
        """
        if self._generator is not None:
            return obs, actions
        element, seen = self._look(obs)
        return seen, self._symmetry.turn_actions(actions, element)

    def seed_draws(self, seed: int) -> None:
        """Let the next actions be drawn from ``seed``; see `Learner.seed_draws`."""
        self.learner.seed_draws(seed)

    def set_progress(self, share: float) -> None:
        """Set how far training is; see `Learner.set_progress`."""
        self.learner.set_progress(share)

    def learn(self) -> dict[str, float] | None:
        """Do the updates that are due; see `Learner.learn`."""
        return self.learner.learn()

    def compile(self) -> None:
        """Compile the updates; see `Learner.compile`."""
        self.learner.compile()

    def state(self) -> dict[str, Tensor]:
        """Copies of everything learnt, by name; see `Learner.state`."""
        return self.learner.state()

    def load(self, state: dict[str, Tensor]) -> None:
        """Restore what `state` returned; see `Learner.load`."""
        self.learner.load(state)

    @property
    def interruptions(self) -> Interruptions:
        """Asked between updates whether training is to stop; see `ResumableLearner`."""
        return self._resumable.interruptions

    @interruptions.setter
    def interruptions(self, interruptions: Interruptions) -> None:
        self._resumable.interruptions = interruptions

    def rings(self) -> dict[str, Ring]:
        """Those of the learner inside; see `ResumableLearner.rings`."""
        return self._resumable.rings()

    def resume_state(self) -> dict[str, Tensor]:
        """All but `state` and `rings`; see `ResumableLearner`."""
        state = under("inside", self._resumable.resume_state())
        return state | ({} if self._generator is None else {"turns": self._generator.get_state()})

    def load_resume_state(self, state: State) -> None:
        """Go on from a state; see `ResumableLearner`."""
        self._resumable.load_resume_state(inside("inside", state))
        if self._generator is not None:
            take_generator(state, "turns", self._generator)

    @property
    def _resumable(self) -> ResumableLearner:
        assert isinstance(self.learner, ResumableLearner)  # as `Parts.resumable` finds out
        return self.learner

    def _look(self, obs: Tensor) -> tuple[Tensor, Tensor]:
        """Elements (B, R) and the turned observations (B, R, D)."""
        if self._generator is None:
            element = self._symmetry.frame(obs)
        else:
            worlds = torch.randint(NUM_ELEMENTS, (len(obs), 1), generator=self._generator)
            element = worlds.to(obs.device).expand(obs.shape[:2])
        return element, self._symmetry.turn(obs, element)


def _own(seed: int) -> int:
    """The seed of this worker's turns: that of worker 0 is ``seed``."""
    if workers.rank() == 0:
        return seed
    return int(workers.own_seed(np.random.SeedSequence(seed)).generate_state(1, np.uint64)[0])
