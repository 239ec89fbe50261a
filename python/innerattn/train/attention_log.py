"""The entropy of attention that training logs, over the steps of a whole episode.

All worlds begin their episodes together, and attention changes in the course of an episode. The
entropy at one control step would therefore rise and fall with the phase of the episode it was
logged in, whatever is learnt.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from math import ceil

import torch
from torch import Tensor

from innerattn.learn.resume import State, take, take_whole, whole
from innerattn.learn.types import Learner
from innerattn.measures.attention import attention_entropy
from innerattn.nn import Actions

_MOST_WORLDS = 64
_MOST_STEPS = 50


class AttentionLog:
    """What the critic attended to in the last control steps, as many as an episode has."""

    def __init__(
        self,
        robot_names: Sequence[str],
        episode_steps: int,
        actions: Actions,
        device: str = "cpu",
    ) -> None:
        """Keep steps of an episode, evenly spread where they are many.

        Args:
            robot_names: of the team.
            episode_steps: length of an episode.
            actions: which actions there are.
            device: where the steps that are added lie.
        """
        self._robot_names, self._actions = tuple(robot_names), actions
        self._device = device
        self._stride = ceil(episode_steps / _MOST_STEPS)
        self._seen: deque[dict[str, Tensor]] = deque(maxlen=ceil(episode_steps / self._stride))
        self._steps = 0

    def add(self, obs: Tensor, actions: Tensor, remembered: Tensor | None = None) -> None:
        """Take one control step of E worlds, of which the first are kept.

        Args:
            obs: (E, R, D) float32, before the step.
            actions: (E, R) int64, or (E, R, W) float32.
            remembered: (E, R, M) float32, what robots remembered before; None without a memory.
        """
        if self._steps % self._stride == 0:
            seen = {"obs": obs, "actions": actions}
            seen |= {} if remembered is None else {"remembered": remembered}
            self._seen.append({key: value[:_MOST_WORLDS].clone() for key, value in seen.items()})
        self._steps += 1

    def resume_state(self) -> dict[str, Tensor]:
        """The steps kept; see `Resumable`."""
        state = {"steps": whole(self._steps)}
        if self._seen:
            state |= {key: torch.stack([one[key] for one in self._seen]) for key in self._seen[0]}
        return state

    def load_resume_state(self, state: State) -> None:
        """Go on from a state; see `Resumable`."""
        self._steps = take_whole(state, "steps")
        self._seen.clear()
        if "obs" in state:
            robots = len(self._robot_names)
            obs = take(state, "obs", torch.float32, None, None, robots, None)
            shape = (*obs.shape[:3], *self._actions.shape)
            actions = take(state, "actions", self._actions.dtype, *shape)
            self._actions.refuse_unknown(actions)
            found = {"obs": obs, "actions": actions}
            if "remembered" in state:
                found["remembered"] = take(state, "remembered", torch.float32, *obs.shape[:3], None)
            for step in range(len(obs)):
                self._seen.append({key: one[step].to(self._device) for key, one in found.items()})

    def entropy(self, learner: Learner) -> dict[str, list[float]]:
        """Mean entropy by robot and head [nats] over the steps kept, with today's weights.

        Returns:
            Empty where the critic has no attention.
        """
        seen = (torch.cat([one[key] for one in self._seen]) for key in self._seen[0])
        weights = learner.attention(*seen)
        if weights is None:
            return {}
        rows = attention_entropy(weights.cpu().numpy()).tolist()
        return dict(zip(self._robot_names, rows, strict=True))
