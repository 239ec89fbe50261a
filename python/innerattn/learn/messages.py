"""The rows that actors with messages take, step by step: what robots see now, and what they said.

Nothing is kept of what was said but the observations that it was made of. So an update makes each
message anew, with a gradient to its sender, however late it arrives.
"""

from __future__ import annotations

from collections import deque

import torch
from torch import Tensor

from innerattn.learn.resume import State, take
from innerattn.nn.message import Hearing, row_width, with_element


class MessageRows:
    """The rows of E worlds, from one control step to the next.

    Before the first steps of an episode robots said nothing. Worlds let nobody hear anything in
    these steps, so what was said in the episode before is never heard.

    Attributes:
        width: Columns of a row.
        now: (R, E, width) of the newest step.
    """

    def __init__(self, num_robots: int, obs_width: int, hearing: Hearing, like: Tensor) -> None:
        """Know no step yet; ``like`` has the dtype and the device."""
        self.width = row_width(obs_width, hearing.delay)
        self._own_width, self._delay = row_width(obs_width, 0), hearing.delay
        self.now = like.new_empty(num_robots, 0, self.width)
        self._past: deque[Tensor] = deque(maxlen=hearing.delay)

    def of_step(self, obs: Tensor, elements: Tensor | None) -> Tensor:
        """Rows of a new step of the worlds, in which robots say what follows from it.

        Args:
            obs: (R, E, D).
            elements: (R, E) int64, elements that turned the worlds into the frames of ``obs``;
                None: none did.
        """
        self.now = self.after_step(obs, elements)
        if self._delay:
            self._past.append(self.now[..., : self._own_width])
        return self.now

    def after_step(self, obs: Tensor, elements: Tensor | None) -> Tensor:
        """Rows of what follows the newest step, in which nobody says anything; as `of_step`."""
        own = with_element(obs, elements)
        if not self._delay:
            return own
        if not self._past or self._past[0].shape != own.shape:
            self._past.extend([torch.zeros_like(own)] * self._delay)
        return torch.cat([own, self._past[0]], dim=2)

    def forget(self) -> None:
        """Begin new episodes in all worlds, of whatever number."""
        self._past.clear()

    def resume_state(self) -> dict[str, Tensor]:
        """What was said and is not heard yet; see `Resumable`."""
        return {"past": torch.stack(tuple(self._past))} if self._past else {}

    def load_resume_state(self, state: State) -> None:
        """Go on from a state; see `Resumable`."""
        self._past.clear()
        if "past" in state:
            shape = self._delay, len(self.now), None, self._own_width
            found = take(state, "past", self.now.dtype, *shape)
            self._past.extend(found.to(self.now.device, copy=True))
