"""Many rescue worlds behind TorchRL's `EnvBase`; the only file below the networks with torch."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from tensordict import TensorDict, TensorDictBase
from torchrl.data import Bounded, Categorical, Composite, Unbounded
from torchrl.envs import EnvBase

from innerattn.config.scenario import Scenario
from innerattn.envs.batch import MOST_SEED, NUM_DISCRETE_ACTIONS, BatchEnv, whole_number
from innerattn.envs.bounds import observation_bounds, state_bounds
from innerattn.envs.view import chosen_scenario, seed_or_random

_ENDS = ("done", "terminated", "truncated")


class RescueTorchRLEnv(EnvBase):  # type: ignore[misc]
    """E rescue worlds of one scenario; robots of a kind are a group.

    For each kind with n robots, in the order of `group_map`:

    - ``(kind, "observation")``: (E, n, D) float32, columns `BatchEnv.observation_names`
    - ``(kind, "action")``: (E, n) int64, or (E, n, 2) float32 where actions are continuous
    - ``(kind, "reward")``: (E, n, 1) float32
    - ``(kind, "action_mask")``: (E, n, 5) bool, True for the discrete actions that have an effect
      in the next step; only where a robot may be unable to act

    At the root are ``state``, (E, S) float32 with the columns of `BatchEnv.state`, and ``done``,
    ``terminated`` and ``truncated``, (E, 1) bool. Ended worlds wait for a reset, which TorchRL's
    rollouts and collectors do, of those worlds alone.

    Args:
        scenario: the world, or the name of a preset.
        num_envs: number of worlds E.
        device: where tensors are; the worlds are on the CPU.
        max_steps: length of an episode [control steps]; none: the scenario's.
        seed: seed of the episodes until `set_seed`; none: a random one.
        num_threads: as of `BatchEnv`.
        first_env: as of `BatchEnv`.
        overrides: fields of `Scenario` to change.

    Attributes:
        group_map: names of the robots of each kind.

    Raises:
        ConfigError: unknown preset or field, or an invalid value.
        TypeError, ValueError: another value of another type, or out of range.
    """

    def __init__(
        self,
        scenario: Scenario | str = "mixed",
        num_envs: int = 1,
        *,
        device: torch.device | str | None = "cpu",
        max_steps: int | None = None,
        seed: int | None = None,
        num_threads: int | None = None,
        first_env: int = 0,
        **overrides: Any,
    ) -> None:
        scenario = chosen_scenario(scenario, max_steps, "max_steps", overrides)
        worlds = BatchEnv(
            scenario,
            num_envs,
            seed_or_random(seed),
            num_threads,
            autoreset="disabled",
            copy=False,
            first_env=first_env,
        )
        super().__init__(device=device, batch_size=torch.Size([worlds.num_envs]))
        self.scenario = scenario
        self._worlds = worlds
        self._next_seed: int | None = None
        self._unseeded = np.zeros(worlds.num_envs, bool)  # they take that seed when they are reset
        self._over = np.zeros((2, worlds.num_envs), bool)  # terminated, truncated
        self._robots: dict[str, list[int]] = {}
        for index, robot in enumerate(scenario.robots):
            self._robots.setdefault(robot.kind, []).append(index)
        names = worlds.robot_names
        self.group_map = {kind: [names[i] for i in own] for kind, own in self._robots.items()}
        self._make_specs()

    def _make_specs(self) -> None:
        low, high = (torch.from_numpy(bound) for bound in observation_bounds(self.scenario))
        observations, actions, rewards = {}, {}, {}
        for kind, own in self._robots.items():
            shape = torch.Size([*self.batch_size, len(own)])
            bounds = (bound.expand(*shape, -1).clone() for bound in (low, high))
            observations[kind] = Composite(observation=Bounded(*bounds), shape=shape)
            if self.scenario.has_action_masks:
                mask = Categorical(2, shape=(*shape, NUM_DISCRETE_ACTIONS), dtype=torch.bool)
                observations[kind]["action_mask"] = mask
            actions[kind] = Composite(action=self._action_spec(shape), shape=shape)
            rewards[kind] = Composite(reward=Unbounded(shape=(*shape, 1)), shape=shape)
        bounds = (torch.from_numpy(bound) for bound in state_bounds(self.scenario))
        state = Bounded(*(bound.expand(*self.batch_size, -1).clone() for bound in bounds))
        place: dict[str, Any] = {"shape": self.batch_size, "device": self.device}
        self.observation_spec = Composite(**observations, state=state, **place)
        self.action_spec = Composite(actions, **place)
        self.reward_spec = Composite(rewards, **place)
        flag = Categorical(2, shape=(*self.batch_size, 1), dtype=torch.bool)
        self.done_spec = Composite({name: flag.clone() for name in _ENDS}, **place)

    def _action_spec(self, shape: torch.Size) -> Bounded | Categorical:
        if self.scenario.actions == "continuous":
            return Bounded(-1.0, 1.0, shape=(*shape, 2))
        return Categorical(NUM_DISCRETE_ACTIONS, shape=shape, dtype=torch.int64)

    def _reset(self, tensordict: TensorDictBase | None = None, **_: Any) -> TensorDictBase:
        mask = None if tensordict is None else tensordict.get("_reset", None)
        everywhere = np.ones(self.num_envs, bool)
        chosen = everywhere if mask is None else mask.reshape(self.num_envs).cpu().numpy()
        seeded = chosen & self._unseeded
        if seeded.any():
            self._worlds.reset(self._next_seed, seeded)
            self._unseeded &= ~chosen
        obs = self._worlds.reset(None, chosen & ~seeded)
        self._over[:, chosen] = False
        return self._seen(obs)

    def _step(self, tensordict: TensorDictBase) -> TensorDictBase:
        parts = {kind: tensordict.get((kind, "action")).cpu().numpy() for kind in self._robots}
        first = next(iter(parts.values()))
        shape = (self.num_envs, self._worlds.num_robots, *first.shape[2:])
        actions = np.empty(shape, first.dtype)
        for kind, own in self._robots.items():
            actions[:, own] = parts[kind]
        step = self._worlds.step(actions)
        self._over[0], self._over[1] = step.terminated, step.truncated
        seen = self._seen(step.obs)
        for kind, own in self._robots.items():
            seen.set((kind, "reward"), torch.from_numpy(step.reward[:, own][..., None]))
        return seen

    def _seen(self, obs: NDArray[np.float32]) -> TensorDictBase:
        """Observations (E, R, D), the state and the ends as tensors of our own."""
        ends = zip(_ENDS, (self._over.any(axis=0), *self._over.copy()), strict=True)
        seen = TensorDict(
            {
                "state": torch.from_numpy(self._worlds.state()),
                **{name: torch.from_numpy(flags[:, None]) for name, flags in ends},
            },
            batch_size=self.batch_size,
        )
        masks = (
            torch.from_numpy(self._worlds.action_mask()) if self.scenario.has_action_masks else None
        )
        for kind, own in self._robots.items():
            part = {"observation": torch.from_numpy(obs[:, own])}  # indexing by a list copies
            if masks is not None:
                part["action_mask"] = masks[:, own]
            seen.set(kind, TensorDict(part, batch_size=(self.num_envs, len(own))))
        return seen.to(self.device) if self.device is not None else seen

    def _set_seed(self, seed: int | None) -> None:
        """Let the next reset of each world begin at the first episode of a seed."""
        self._next_seed = None if seed is None else whole_number("seed", seed, 0, MOST_SEED)
        self._unseeded[:] = seed is not None

    @property
    def num_envs(self) -> int:
        """Number of worlds E."""
        return self._worlds.num_envs

    def state(self) -> torch.Tensor:
        """The whole of each world, (E, S) float32; `BatchEnv.state` has the columns."""
        return torch.from_numpy(self._worlds.state()).to(self.device)

    def close(self, *, raise_if_closed: bool = True) -> None:
        """Free the worlds; the environment cannot be used afterwards."""
        super().close(raise_if_closed=raise_if_closed)
        self._worlds.close()
