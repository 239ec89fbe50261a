"""Rollouts of on-policy learners: a buffer that is filled in place, and rows to train on."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from innerattn.learn import workers
from innerattn.learn.recall import Recall, RecalledSteps, sequences_of
from innerattn.learn.resume import State, inside, take, take_within, under
from innerattn.learn.types import Team, Transitions

_ROUNDING = 8.0  # units in the last place of the largest advantage, by which equal ones differ


class Arrivals(NamedTuple):
    """The n steps of a rollout with which victims appeared, and the worlds without these victims.

    Attributes:
        step: (n,) int64.
        env: (n,) int64.
        states: (n, S).
    """

    step: Tensor
    env: Tensor
    states: Tensor


class Steps(NamedTuple):
    """T control steps of E worlds; rows go through the worlds of a step, step after step.

    Attributes:
        obs: (R, T * E, D), in memory (T * E, R, D).
        actions: (R, T * E) int64, or (R, T * E, W) float32.
        log_probs: (R, A, T * E) of all actions when these were drawn; None if they are not known.
        reward: (T, R, E).
        terminated: (T, E) bool.
        ended: (T, E) bool, terminated or truncated by a time limit.
        cut: (T, E) bool, steps whose successor is not in the rollout: ends, and the last step.
        after: (R, n, D) observations after the n cut steps, of the same episode, in order.
        arrivals: Where victims appeared; None if that was not told with every step.
        recall: What robots remembered before each step; None without a memory.
        after_recall: What they remembered after the n cut steps; None likewise.
    """

    obs: Tensor
    actions: Tensor
    log_probs: Tensor | None
    reward: Tensor
    terminated: Tensor
    ended: Tensor
    cut: Tensor
    after: Tensor
    arrivals: Arrivals | None
    recall: Recall | None
    after_recall: Recall | None


class RolloutBuffer:
    """T control steps, written where the updates read them. It is used again and again."""

    def __init__(
        self,
        steps: int,
        team: Team,
        device: torch.device,
        dtype: torch.dtype,
        memory_width: int = 0,
    ) -> None:
        """Reserve nothing yet: the first step says how many worlds there are.

        Args:
            steps: T.
            team: Sizes of the team.
            device: Where the buffer is held.
            dtype: Type of observations and log-probabilities.
            memory_width: M, numbers that a robot remembers; 0: none.
        """
        self._num_steps, self._team, self._memory_width = steps, team, memory_width
        self._device, self._dtype = device, dtype
        self._envs = 0
        self._filled = 0
        self._all_known = True
        self._after: list[Tensor] = []
        self._recalled: RecalledSteps | None = None
        self._arrivals: list[Arrivals] = []

    @property
    def full(self) -> bool:
        """Whether T steps are held."""
        return self._filled == self._num_steps

    def clear(self) -> None:
        """Hold no step; the memory is kept."""
        self._filled, self._all_known, self._after, self._arrivals = 0, True, [], []
        if self._recalled is not None:
            self._recalled.clear()

    def add(
        self,
        batch: Transitions,
        truncated: Tensor,
        log_probs: Tensor | None,
        memories: tuple[Tensor, Tensor] | None = None,
    ) -> None:
        """Take one control step.

        Args:
            batch: The E transitions.
            truncated: (E,) bool.
            log_probs: (R, A, E) of all actions, under the policy that acted; None if not known.
            memories: (R, E, M) what robots remembered before the step, and after it; None: they
                have no memory.
        """
        if len(batch.obs) != self._envs:
            self._reserve(len(batch.obs))
        step = self._filled
        self._obs[step].copy_(batch.obs)
        self._actions[:, step].copy_(batch.actions.transpose(0, 1))
        self._reward[step].copy_(batch.reward.t())
        self._terminated[step].copy_(batch.terminated)
        ended = self._ended[step]
        ended.copy_(batch.terminated | truncated)
        if log_probs is None:
            self._all_known = False
        else:
            self._log_probs[:, :, step].copy_(log_probs)
        if batch.afterstates is not None:
            env, states = (tensor.to(self._device) for tensor in batch.afterstates)
            self._arrivals.append(Arrivals(torch.full_like(env, step), env, states.to(self._dtype)))
        self._filled += 1
        cut = batch.next_obs if self.full else batch.next_obs[ended.to(batch.next_obs.device)]
        self._after.append(cut.to(self._device, self._dtype))
        if self._recalled is not None and memories is not None:
            self._recalled.add(
                step, memories, batch, torch.ones_like(ended) if self.full else ended
            )

    def steps(self) -> Steps:
        """The steps of a full buffer; views, valid until the next `add`."""
        cut = self._ended.clone()
        cut[-1] = True
        return Steps(
            obs=self._obs.flatten(0, 1).transpose(0, 1),
            actions=self._actions.flatten(1, 2),
            log_probs=self._log_probs.flatten(2) if self._all_known else None,
            reward=self._reward,
            terminated=self._terminated,
            ended=self._ended,
            cut=cut,
            after=torch.cat(self._after).transpose(0, 1),
            arrivals=self._all_arrivals() if len(self._arrivals) == self._filled else None,
            recall=None if self._recalled is None else self._recalled.before(),
            after_recall=None if self._recalled is None else self._recalled.after(),
        )

    def _all_arrivals(self) -> Arrivals:
        return Arrivals._make(torch.cat(parts) for parts in zip(*self._arrivals, strict=True))

    def resume_state(self) -> dict[str, Tensor]:
        """The steps held; see `Resumable`."""
        if not self._filled:
            return {}
        held = self._filled
        state = {
            "obs": self._obs[:held].permute(2, 0, 1, 3),
            "actions": self._actions[:, :held],
            "reward": self._reward[:held],
            "terminated": self._terminated[:held].to(torch.uint8),
            "ended": self._ended[:held].to(torch.uint8),
            "after": torch.cat(self._after),
        }
        if self._arrivals:
            state |= {f"arrivals.{k}": v for k, v in self._all_arrivals()._asdict().items()}
        if self._recalled is not None:
            state |= under("recalled", self._recalled.resume_state(held))
        return state | ({"log_probs": self._log_probs[:, :, :held]} if self._all_known else {})

    def load_resume_state(self, state: State) -> None:
        """Go on from a state; see `Resumable`."""
        self.clear()
        if not state:
            return
        robots, width, num_actions = self._team[:3]
        found = take(state, "obs", self._dtype, robots, None, None, width)
        held, envs = found.shape[1:3]
        if not (0 < held <= self._num_steps and envs):
            raise ValueError(
                f"'obs' has {held} steps of {envs} worlds: must be 1 to {self._num_steps}"
            )
        self._reserve(envs)
        self._obs[:held] = found.permute(1, 2, 0, 3)
        self._actions[:, :held] = _take_actions(state, self._team, held, envs)
        self._reward[:held] = take(state, "reward", torch.float32, held, robots, envs)
        flags = {
            name: take_within(state, name, torch.uint8, 0, 1, held, envs)
            for name in ("terminated", "ended")
        }
        self._terminated[:held] = flags["terminated"].bool()
        self._ended[:held] = flags["ended"].bool()
        self._all_known = "log_probs" in state
        if self._all_known:
            known = take(state, "log_probs", self._dtype, robots, num_actions, held, envs)
            self._log_probs[:, :, :held] = known
        self._filled = held
        cut = int(flags["ended"].sum())
        if self.full:
            cut += int((flags["ended"][-1] == 0).sum())
        after = take(state, "after", self._dtype, cut, robots, width)
        self._after = [after.to(self._device)]
        if self._recalled is not None:
            self._recalled.load_resume_state(inside("recalled", state), held, cut)
        if "arrivals.states" in state:
            self._arrivals = self._taken_arrivals(state, held, envs)

    def _taken_arrivals(self, state: State, held: int, envs: int) -> list[Arrivals]:
        """Arrivals of a state, step by step."""
        states = take(state, "arrivals.states", self._dtype, None, None)
        step = take_within(state, "arrivals.step", torch.int64, 0, held - 1, len(states))
        env = take_within(state, "arrivals.env", torch.int64, 0, envs - 1, len(states))
        whole = Arrivals(*(tensor.to(self._device) for tensor in (step, env, states)))
        return [Arrivals._make(tensor[whole.step == k] for tensor in whole) for k in range(held)]

    def _reserve(self, envs: int) -> None:
        """Make the memory for E worlds; what is held is dropped."""
        robots, steps = self._team.num_robots, self._num_steps
        self._envs = envs
        like = torch.empty((), dtype=self._dtype, device=self._device)
        # Worlds before robots, as the worlds give them: a minibatch then copies a row in one piece,
        # and a critic takes the robots' observations side by side without a copy.
        self._obs = like.new_empty(steps, envs, robots, self._team.obs_width)
        self._log_probs = like.new_empty(robots, self._team.num_actions, steps, envs)
        kind = self._team.actions
        self._actions = like.new_empty(robots, steps, envs, *kind.shape, dtype=kind.dtype)
        self._reward = like.new_empty(steps, robots, envs, dtype=torch.float32)
        self._terminated = like.new_empty(steps, envs, dtype=torch.bool)
        self._ended = like.new_empty(steps, envs, dtype=torch.bool)
        if self._memory_width:
            self._recalled = RecalledSteps((robots, steps, envs, self._memory_width), like)
        self.clear()


class Rollout(NamedTuple):
    """Rows of a rollout, robots first.

    With a memory, rows are S sequences of L steps: all first steps, then all second ones.

    Attributes:
        obs: (R, B, D), in memory (B, R, D).
        actions: (R, B) int64, or (R, B, W) float32.
        log_prob: (R, B) of the actions, under the policy that acted.
        advantage: (R, B).
        target: (R, B) for the critic's values.
        recall: What robots remembered before the S sequences; None without a memory.
    """

    obs: Tensor
    actions: Tensor
    log_prob: Tensor
    advantage: Tensor
    target: Tensor
    recall: Recall | None = None

    @property
    def units(self) -> int:
        """What `take` chooses from: sequences, or rows without a memory."""
        return self.obs.shape[1] if self.recall is None else self.recall.remembered.shape[1]

    def take(self, units: Tensor) -> Rollout:
        """Some rows, or sequences, by their indices (n,) int64.

        Observations keep their order in memory.
        """
        rows, recall = units, self.recall
        if recall is not None:
            rows, recall = recall.rows_of(units), recall.take(units)
        taken = self.obs.transpose(0, 1).index_select(0, rows).transpose(0, 1)
        actions, *others = (one.index_select(1, rows) for one in self[1:5])
        log_prob, advantage, target = others
        return Rollout(taken, actions, log_prob, advantage, target, recall)

    def tensors(self) -> tuple[Tensor | None, ...]:
        """All fields, those of `recall` one by one, which may be missing."""
        return *self[:5], *(self.recall or (None, None, None))

    def resume_state(self) -> dict[str, Tensor]:
        """All fields that there are, by name; see `Resumable`."""
        state = dict(zip(self._fields, self[:5], strict=False))
        return state if self.recall is None else state | self.recall.resume_state()

    @classmethod
    def taken_from(cls, state: State, team: Team, like: Tensor, memory_width: int = 0) -> Rollout:
        """The rollout whose fields are in a state by name, as `resume_state` gives them.

        Args:
            state: By name.
            team: Sizes of the team.
            like: Has the dtype and the device of all but the actions.
            memory_width: M, numbers that a robot remembers.

        Raises:
            ValueError: As in `take`.
        """
        robots, width = team[:2]
        obs = take(state, "obs", like.dtype, robots, None, width)
        shape = (robots, obs.shape[1])
        own = [take(state, name, like.dtype, *shape) for name in cls._fields[2:5]]
        log_prob, advantage, target = (one.to(like.device) for one in own)
        return cls(
            obs.transpose(0, 1).contiguous().transpose(0, 1).to(like.device),
            _take_actions(state, team, shape[1]).to(like.device),
            log_prob,
            advantage,
            target,
            Recall.taken_from(state, shape, memory_width, like) if memory_width else None,
        )


def in_sequences(rollout: Rollout, steps: Steps, length: int) -> Rollout:
    """The rows of T control steps of E worlds as T / L * E sequences of L steps.

    Args:
        rollout: Its rows go through the worlds of a step, step after step.
        steps: The same steps, with what robots remembered.
        length: L, which divides T.
    """
    assert steps.recall is not None  # there are memories
    order, recall = sequences_of(steps.recall, steps.ended, length)
    return rollout.take(order)._replace(recall=recall)


def _take_actions(state: State, team: Team, *shape: int) -> Tensor:
    """Actions (R, *shape, ...) of a state, all of which there are.

    Raises:
        ValueError: As in `take`, or one is out of range.
    """
    kind = team.actions
    found = take(state, "actions", kind.dtype, team.num_robots, *shape, *kind.shape)
    kind.refuse_unknown(found)
    return found


def rows_of(steps: Tensor) -> Tensor:
    """Bring (T, R, E, ...) to rows (R, T * E, ...)."""
    return steps.transpose(0, 1).flatten(1, 2)


def steps_of(rows: Tensor, num_steps: int) -> Tensor:
    """Bring rows (R, T * E) back to (T, R, E)."""
    return rows.view(len(rows), num_steps, -1).transpose(0, 1)


def standardised(advantage: Tensor) -> Tensor:
    """Advantages (R, B) with mean 0 and standard deviation 1 for each robot, over all workers.

    They are 0 where they differ by no more than rounding: divided by their deviation, rounding
    would pass for advantages.
    """
    centred = advantage - workers.mean(advantage.mean(dim=1, keepdim=True))
    if workers.count() == 1:
        deviation = advantage.std(dim=1, correction=0, keepdim=True)
    else:
        deviation = workers.mean(centred.square().mean(dim=1, keepdim=True)).sqrt()
    highest = workers.largest(advantage.abs().amax(dim=1, keepdim=True))
    rounding = _ROUNDING * torch.finfo(advantage.dtype).eps * highest
    # Asked in this way, so that NaN stays NaN and divergence is found.
    return torch.where(deviation <= rounding, 0.0, centred / (deviation + 1e-8))
