"""Advantages, and the scale of returns, from collected steps. Time is the first dimension.

Sources: Schulman et al. 2016, eq. 16 (generalised advantage estimation); for time limits Pardo et
al. 2018: the value of the state at which a time limit ended the episode still counts.
"""

from __future__ import annotations

import torch
from torch import Tensor

from innerattn.learn import workers
from innerattn.learn.resume import State, take

_ROUNDING = 1e-9  # share of a mean of returns in float64, by which equal ones differ at most


def generalised_advantage(
    reward: Tensor,
    value: Tensor,
    next_value: Tensor,
    terminated: Tensor,
    ended: Tensor,
    gamma: float,
    gae_lambda: float,
) -> Tensor:
    """A_t = d_t + gamma lambda A_t+1 with d_t = r_t + gamma V(s'_t) - V(s_t), within an episode.

    Args:
        reward: (T, R, E).
        value: (T, R, E) value of each step's state.
        next_value: (T, R, E) value of the state after the step, in the same episode.
        terminated: (T, E) bool; nothing comes after a termination.
        ended: (T, E) bool, terminated or truncated by a time limit.
        gamma: Discount of a control step.
        gae_lambda: lambda; 0 looks one step ahead, 1 to the end.

    Returns:
        (T, R, E); A + V are the lambda-returns.
    """
    alive = (~terminated).to(reward.dtype).unsqueeze(1)
    delta = reward + gamma * alive * next_value - value
    carry = gamma * gae_lambda * (~ended).to(reward.dtype).unsqueeze(1)
    advantage = torch.empty_like(delta)
    later = torch.zeros_like(delta[0])
    for step in range(len(delta) - 1, -1, -1):
        later = delta[step] + carry[step] * later
        advantage[step] = later
    return advantage


class ReturnScale:
    """Running standard deviation of discounted returns, by which rewards are divided.

    Attributes:
        gamma: Discount of a control step.
        count: () float64, number of returns.
        mean: (R,) float64.
        squares: (R,) float64, sum of squared differences from the mean.
    """

    def __init__(self, num_robots: int, gamma: float, device: torch.device) -> None:
        """Start without returns; rewards of ``num_robots`` robots are discounted by ``gamma``."""
        self.gamma = gamma
        self._open: Tensor | None = None
        self.count = torch.zeros((), dtype=torch.float64, device=device)
        self.mean = torch.zeros(num_robots, dtype=torch.float64, device=device)
        self.squares = torch.zeros_like(self.mean)

    def update(self, reward: Tensor, ended: Tensor) -> None:
        """Add rewards (T, R, E) and ends of episodes (T, E); they follow those of the last call."""
        returns = []
        before = self._open
        for step_reward, step_ended in zip(reward.double(), ended, strict=True):
            before = step_reward if before is None else step_reward + self.gamma * before
            returns.append(before)
            before = before * ~step_ended
        self._open = before
        seen = torch.stack(returns, dim=1).flatten(1)  # (R, T * E)
        added = seen.shape[1] * workers.count()
        # Chan's rule for the moments of two samples together.
        mean = workers.mean(seen.mean(dim=1))
        apart = mean - self.mean
        self.squares += workers.total((seen - mean.unsqueeze(1)).square().sum(dim=1))
        self.squares += apart.square() * self.count * added / (self.count + added)
        self.mean += apart * added / (self.count + added)
        self.count += added

    def forget_open_returns(self) -> None:
        """Let the next rewards begin episodes: those before them are not the learner's."""
        self._open = None

    def has_spread(self) -> Tensor:
        """(R,) bool: whether the returns of a robot have differed by more than rounding."""
        return self.squares > self.count * (_ROUNDING * self.mean).square()

    def tensors(self) -> dict[str, Tensor]:
        """Live tensors by name, to be saved."""
        return {"count": self.count, "mean": self.mean, "squares": self.squares}

    def resume_state(self) -> dict[str, Tensor]:
        """The returns of episodes that have not ended; see `Resumable`."""
        return {} if self._open is None else {"open": self._open}

    def load_resume_state(self, state: State) -> None:
        """Go on from a state; see `Resumable`."""
        self._open = None
        if state:
            found = take(state, "open", torch.float64, len(self.mean), None)
            self._open = found.to(self.mean.device)

    def std(self, floor: float) -> Tensor:
        """(R,) float64, the standard deviation, at least ``floor``."""
        return (self.squares / self.count.clamp_min(1.0)).sqrt().clamp_min(floor)
