"""What the robots of a batch of worlds remember while they act, by actors and by critics."""

from __future__ import annotations

import torch
from torch import Tensor

from innerattn.learn.resume import State, take
from innerattn.nn import ListeningActor, RememberingActor, RememberingCritic


class Memories:
    """The memories of E worlds, from one control step to the next.

    A memory has 2 W numbers: those of the actor, then those of the critic. All are 0 where an
    episode begins. Vectors in it lie as in the world.

    Attributes:
        before: (R, E, 2 W) before the newest observation.
        now: (R, E, 2 W) after it.
    """

    def __init__(
        self,
        actor: RememberingActor | ListeningActor,
        critic: RememberingCritic,
        obs_width: int,
        like: Tensor,
    ) -> None:
        """Remember nothing yet, of no world.

        Args:
            actor: Has a memory, perhaps behind messages.
            critic: Its memory is as wide.
            obs_width: D.
            like: Has the dtype and the device.
        """
        self._actor, self._critic, self._obs_width = actor, critic, obs_width
        self._width = 2 * critic.memory.width
        self.before = like.new_zeros(actor.num_robots, 0, self._width)
        self.now = self.before

    def act(self, rows: Tensor, elements: Tensor | None = None) -> Tensor:
        """Outputs of the policies for rows (R, E, D or more), which are remembered from now on.

        Rows are what the actor takes: observations, and what messages need behind them. Frames are
        turned by ``elements`` (R, E), if there are any.
        """
        if rows.shape[1] != self.now.shape[1]:
            self.now = self.now.new_zeros(len(rows), rows.shape[1], self._width)
        self.before = self.now
        of_actor, of_critic = parts_of(self.before)
        outputs, of_actor = self._actor.act(rows, of_actor, elements)
        of_critic = self._critic.remember(rows[..., : self._obs_width], of_critic, elements)
        self.now = torch.cat([of_actor, of_critic], dim=2)
        return outputs

    def forget(self, ended: Tensor | None = None) -> None:
        """Forget everything where episodes ended, (E,) bool; None: in all worlds."""
        if ended is None:
            self.now = torch.zeros_like(self.now)
        else:
            self.now = self.now.masked_fill(ended.to(self.now.device).unsqueeze(1), 0.0)

    def resume_state(self) -> dict[str, Tensor]:
        """What is remembered; see `Resumable`."""
        return {"now": self.now}

    def load_resume_state(self, state: State) -> None:
        """Go on from a state; see `Resumable`."""
        robots = len(self.now)
        found = take(state, "now", self.now.dtype, robots, None, self._width)
        if bool((found.abs() > 1.0).any()):
            raise ValueError("'now': must be in -1..=1")
        self.now = found.to(self.now.device, copy=True)


def parts_of(remembered: Tensor) -> tuple[Tensor, Tensor]:
    """The memories of actors and of critics in (..., 2 W)."""
    of_actor, of_critic = remembered.chunk(2, dim=-1)
    return of_actor, of_critic
