"""Imitation of a scripted policy before learning from rewards: DAgger, after Ross et al. 2011.

The learner acts in the worlds, so that it meets the states to which its own mistakes lead. A script
sees the true state and labels these states with its actions. Any `Learner` can imitate.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import torch
from torch import Tensor

from innerattn.config import RunConfig
from innerattn.envs import BatchEnv
from innerattn.envs.batch import NUM_DISCRETE_ACTIONS
from innerattn.learn import workers
from innerattn.learn.resume import State, inside, take_generator, take_whole, under, whole
from innerattn.learn.ring import Ring
from innerattn.learn.types import Learner, Transitions
from innerattn.policies import PolicyInput, WorldState, scripted_policy
from innerattn.train.collect import Collector


class Imitation:
    """One learner that imitates one script."""

    def __init__(
        self, config: RunConfig, env: BatchEnv, learner: Learner, collector: Collector
    ) -> None:
        """Prepare to imitate `train.warm_start`; ``collector`` steps ``learner`` in ``env``.

        Raises:
            ConfigError: no such script.
            MemoryError: `imitation.memory_env_steps` is too large.
        """
        self._config = config.imitation
        self._script = scripted_policy(config.train.warm_start, env.scenario)
        self._env, self._learner, self._collector = env, learner, collector
        capacity = min(
            workers.share_of(self._config.memory_env_steps),
            workers.share_of(self._config.env_steps) + env.num_envs,
        )
        shape = (capacity, env.num_robots, env.obs_width)
        try:
            self._memory = _Memory(shape, config.train.seed)
        except MemoryError as error:
            given = capacity * workers.count()
            raise MemoryError(f"imitation.memory_env_steps = {given}: {error}") from error
        self._pending_env_steps = 0

    @property
    def env_steps(self) -> int:
        """Length of the imitation, summed over worlds."""
        return self._config.env_steps

    def collect(self, share: float) -> tuple[Transitions, dict[str, float]]:
        """One control step of all worlds, and the training steps of the actors that are due.

        Args:
            share: Part of the imitation that is done, 0 to 1.

        Returns:
            The transitions, and metrics by name: `agreement`, the share of the actions now drawn
            that are the script's; `imitation_loss` [nats], the mean over the actors' steps, if
            there were any.
        """
        wanted = torch.from_numpy(
            self._script.act(PolicyInput(self._env.observe(), WorldState.of(self._env)))
        )
        transitions, truncated = self._collector.step()
        self._memory.add(transitions.obs, wanted)
        agreement = (transitions.actions.cpu() == wanted).float().mean()
        metrics = {"agreement": float(workers.mean(agreement))}
        losses = self._imitate(share)
        if losses:
            metrics["imitation_loss"] = sum(losses) / len(losses)
        if self._critic_learns(share):
            with self._frozen_actor():
                self._learner.observe(transitions, truncated)
        return transitions, metrics

    def learn(self, share: float) -> dict[str, float]:
        """Let the critic learn after `collect`, in the last part; the learner's metrics."""
        if not self._critic_learns(share):
            return {}
        with self._frozen_actor():
            return self._learner.learn() or {}

    def rings(self) -> dict[str, Ring]:
        """The labelled states; see `ResumableLearner.rings`."""
        return {"labels": self._memory.ring}

    def resume_state(self) -> dict[str, Tensor]:
        """All but the labelled states; see `Resumable`."""
        pending = {"pending": whole(self._pending_env_steps)}
        return pending | under("memory", self._memory.resume_state())

    def load_resume_state(self, state: State) -> None:
        """Go on from a state; see `Resumable`."""
        self._pending_env_steps = take_whole(state, "pending")
        self._memory.load_resume_state(inside("memory", state))

    def _critic_learns(self, share: float) -> bool:
        return (1.0 - share) * self._config.env_steps <= self._config.critic_env_steps

    @contextmanager
    def _frozen_actor(self) -> Iterator[None]:
        self._learner.actor_frozen = True
        try:
            yield
        finally:
            self._learner.actor_frozen = False

    def _imitate(self, share: float) -> list[float]:
        """Do the training steps of the actors that are due, and return their losses."""
        config = self._config
        self._pending_env_steps += self._env.num_envs * workers.count()
        due, self._pending_env_steps = divmod(
            self._pending_env_steps, config.update_every_env_steps
        )
        rate = config.learning_rate * (1.0 - (1.0 - config.final_learning_rate_share) * share)
        size = workers.share_of(config.batch_size)
        return [self._learner.imitate(*self._memory.sample(size), rate) for _ in range(due)]


class _Memory:
    """The newest labelled states, drawn uniformly with replacement."""

    def __init__(self, shape: tuple[int, int, int], seed: int) -> None:
        """Reserve the memory for observations of this shape, (capacity, R, D).

        Raises:
            MemoryError: there is not that much.
        """
        self._obs = torch.from_numpy(np.empty(shape, np.float32))
        self._actions = torch.from_numpy(np.empty(shape[:2], np.uint8))
        self.ring = Ring(obs=self._obs, actions=self._actions)
        own = workers.own_seed(np.random.SeedSequence([seed, 1]))
        number = own.generate_state(1, np.uint64)[0]
        self._generator = torch.Generator().manual_seed(int(number))

    def add(self, obs: Tensor, actions: Tensor) -> None:
        """Store states (E, R, D) and the actions that the script would take there (E, R)."""
        rows = torch.arange(len(obs))[-self.ring.capacity :]  # if more than fit, the last
        place = (self.ring.seen + rows) % self.ring.capacity
        self._obs[place] = obs.cpu()[rows]
        self._actions[place] = actions.to(torch.uint8)[rows]
        self.ring.seen += len(obs)

    def sample(self, count: int) -> tuple[Tensor, Tensor]:
        """States (B, R, D) float32 and actions (B, R) int64."""
        rows = torch.randint(self.ring.held, (count,), generator=self._generator)
        return self._obs[rows], self._actions[rows].long()

    def resume_state(self) -> dict[str, Tensor]:
        """All but the rows; see `Resumable`."""
        return {"generator": self._generator.get_state()}

    def load_resume_state(self, state: State) -> None:
        """Go on from a state, once the rows are in `ring`; see `Resumable`."""
        take_generator(state, "generator", self._generator)
        held = self.ring.held
        known = (self._actions[:held] < NUM_DISCRETE_ACTIONS).all()
        if not bool(known) or not bool(self._obs[:held].isfinite().all()):
            raise ValueError("labels: must be finite, with actions that there are")
