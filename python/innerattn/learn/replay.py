"""A ring buffer of transitions, one contiguous row each, with statistics of their rewards.

It stores and draws; it does not normalise. Where a run weighs the parts of its rewards, the parts
are stored, and every draw weighs them as it is right now.
"""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from innerattn.learn import workers
from innerattn.learn.resume import State, take, take_generator
from innerattn.learn.ring import Ring
from innerattn.learn.types import Team, Transitions


class Replay:
    """The last `capacity` transitions, drawn uniformly with replacement.

    A row is obs, next_obs, actions, reward or its parts, terminated, all float32 (actions are small
    integers, which float32 holds exactly), so that a batch is one gather of whole rows.

    Attributes:
        ring: The rows, for who saves them.
        generator: Source of the draws.
    """

    def __init__(
        self,
        capacity: int,
        team: Team,
        seed: int,
        device: torch.device | None = None,
        reward_parts: int = 1,
    ) -> None:
        """Reserve the memory.

        Args:
            capacity: Transitions held at most; older ones are overwritten.
            team: Sizes of the team.
            seed: Seed of the draws.
            device: Where rows are held; None: the CPU.
            reward_parts: P, parts of a reward; 1: rewards are stored whole.

        Raises:
            ValueError: The capacity is less than 1.
        """
        if capacity < 1:
            raise ValueError(f"capacity = {capacity}: must be at least 1 transition")
        robots, width = team.num_robots, team.num_robots * team.obs_width
        self._team = team
        self._parts = reward_parts
        self._weights = torch.ones(reward_parts, device=device)
        self._splits = [width, width, robots, robots * reward_parts, 1]
        # NumPy asks the system for huge pages, with which a draw of rows is twice as fast.
        rows = np.empty((capacity, sum(self._splits)), np.float32)
        self._rows = torch.from_numpy(rows).to(device or "cpu")
        self._reward = slice(2 * width + robots, 2 * width + (1 + reward_parts) * robots)
        self.generator = torch.Generator(self._rows.device).manual_seed(seed)
        self.ring = Ring(rows=self._rows)
        # Of rewards, or of each product of two parts: enough for the moments under any weights.
        self._sum = torch.zeros(robots, reward_parts, dtype=torch.float64, device=device)
        self._sum_of_products = self._sum.new_zeros(robots, reward_parts, reward_parts)

    def weigh(self, weights: Tensor) -> None:
        """Weigh the parts of all rewards by ``weights`` (P,) from now on."""
        self._weights = weights.to(self._rows)

    def __len__(self) -> int:
        """Transitions held."""
        return self.ring.held

    @property
    def capacity(self) -> int:
        """Transitions held at most."""
        return self.ring.capacity

    @property
    def parts(self) -> int:
        """P, parts of a reward."""
        return self._parts

    @property
    def reward_mean(self) -> Tensor:
        """(R,) float64, mean reward of each robot over all that workers hold; 0 when empty."""
        return self.reward_moments()[0]

    @property
    def reward_std(self) -> Tensor:
        """(R,) float64, its population standard deviation; 0 when empty."""
        return self.reward_moments()[1]

    def reward_moments(self) -> tuple[Tensor, Tensor]:
        """`reward_mean` and `reward_std`, in one exchange of all workers."""
        _, (total, products) = workers.averaged([], [self._sum, self._sum_of_products])
        weights, held = self._weights.double(), max(len(self), 1)
        mean = total @ weights / held
        mean_of_squares = products @ weights @ weights / held
        return mean, (mean_of_squares - mean.square()).clamp_min(0.0).sqrt()

    def add(self, batch: Transitions) -> None:
        """Take in transitions, oldest first; of more than `capacity` only the last are kept.

        Raises:
            ValueError: The batch is of another team, or lacks the parts of its rewards.
        """
        expected = (self._team.num_robots, self._team.obs_width)
        if tuple(batch.obs.shape[1:]) != expected:
            raise ValueError(
                f"obs of shape {tuple(batch.obs.shape)}: must be (B, R, D) with R, D = {expected}"
            )
        terminated = batch.terminated.unsqueeze(1)
        reward = batch.reward if self._parts == 1 else batch.reward_parts
        if reward is None or (self._parts > 1 and reward.shape[2] != self._parts):
            raise ValueError(f"reward_parts: must be (B, R, P) with P = {self._parts}")
        parts = (batch.obs, batch.next_obs, batch.actions, reward, terminated)
        rows = torch.cat([part.flatten(1).to(self._rows) for part in parts], dim=1)
        rows = rows[-self.capacity :]
        fits = min(len(rows), self.capacity - self.ring.seen % self.capacity)
        self._write(rows[:fits])
        self._write(rows[fits:])

    def sample(self, batch_size: int) -> Transitions:
        """Draw transitions, each with equal chance; the same one may come twice.

        Args:
            batch_size: B.

        Raises:
            ValueError: Nothing is held.
        """
        if not len(self):
            raise ValueError("replay is empty: add transitions before sampling")
        device = self._rows.device
        index = torch.randint(len(self), (batch_size,), generator=self.generator, device=device)
        rows = self._rows.index_select(0, index)
        obs, next_obs, actions, reward, terminated = torch.split_with_sizes(
            rows, self._splits, dim=1
        )
        shape = (batch_size, self._team.num_robots, self._team.obs_width)
        if self._parts > 1:
            reward = reward.view(batch_size, self._team.num_robots, self._parts) @ self._weights
        return Transitions(
            obs.view(shape),
            actions.to(torch.int64),
            reward,
            next_obs.view(shape),
            terminated.squeeze(1) > 0.5,
        )

    def resume_state(self) -> dict[str, Tensor]:
        """All but the rows; see `Resumable`."""
        return {
            "sum": self._sum,
            "sum_of_products": self._sum_of_products,
            "generator": self.generator.get_state(),
        }

    def load_resume_state(self, state: State) -> None:
        """Go on from a state, once the rows are in `ring`; see `Resumable`."""
        robots, parts = self._team.num_robots, self._parts
        self._sum.copy_(take(state, "sum", torch.float64, robots, parts))
        products = take(state, "sum_of_products", torch.float64, robots, parts, parts)
        self._sum_of_products.copy_(products)
        take_generator(state, "generator", self.generator)
        held = self._rows[: len(self)]
        actions = held[:, self._splits[0] * 2 : self._reward.start]
        known = (actions >= 0) & (actions < self._team.num_actions) & (actions == actions.round())
        if not bool(held.isfinite().all()) or not bool(known.all()):
            raise ValueError("rows: must be finite, with actions that there are")

    def _write(self, rows: Tensor) -> None:
        """Put the next rows where they fit, and keep the statistics true to what is held."""
        start = self.ring.seen % self.capacity
        place = self._rows[start : start + len(rows)]
        replaced = self._moments(place[: max(0, len(self) - start)])
        added = self._moments(rows)
        self._sum += added[0] - replaced[0]
        self._sum_of_products += added[1] - replaced[1]
        place.copy_(rows)
        self.ring.seen += len(rows)

    def _moments(self, rows: Tensor) -> tuple[Tensor, Tensor]:
        """Sums (R, P) of the parts of rewards, and (R, P, P) of their products."""
        shape = (len(rows), self._team.num_robots, self._parts)
        parts = rows[:, self._reward].double().reshape(shape)
        return parts.sum(0), (parts.unsqueeze(3) * parts.unsqueeze(2)).sum(0)
