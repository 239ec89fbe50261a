"""Many rescue worlds behind Gymnasium's `VectorEnv`, stepped together by `BatchEnv`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from innerattn.config.scenario import Scenario
from innerattn.envs.batch import MOST_SEED, Autoreset, BatchEnv, Step, whole_number
from innerattn.envs.spaces import state_space
from innerattn.envs.team import Form, TeamForm, team_rewards
from innerattn.envs.view import (
    STEPS_PER_SECOND,
    Screen,
    chosen_scenario,
    seed_or_random,
    usable_modes,
)
from innerattn.errors import ConfigError

_AUTORESET: dict[AutoresetMode, Autoreset] = {
    AutoresetMode.SAME_STEP: "same_step",
    AutoresetMode.NEXT_STEP: "next_step",
    AutoresetMode.DISABLED: "disabled",
}
Flags = NDArray[np.bool_]
Infos = dict[str, Any]

_MODES = ["rgb_array"]


class RescueVectorEnv(VectorEnv[Any, Any, NDArray[Any]]):
    """E rescue worlds for `gymnasium.make_vec("innerattn/Rescue-v0", num_envs=E)`.

    Worlds, rewards and infos are those of `RescueEnv`, batched as Gymnasium's `SyncVectorEnv` does:
    infos are arrays with a mask, and with same-step autoreset ``final_obs`` and ``final_info`` hold
    what belongs to the ended episodes. World i is world i of a `BatchEnv` under the same seed.

    Args:
        num_envs: number of worlds E.
        scenario: the world, or the name of a preset.
        autoreset_mode: Gymnasium's mode or its value; `metadata["autoreset_mode"]` has it.
        copy: give arrays of your own; if False, observations, terminations, truncations and
            ``robot_rewards`` are read-only views that are valid until the step after next.
        form: as of `RescueEnv`.
        render_mode: none, or "rgb_array" for `render` to give a picture of each world.
        max_episode_steps: length of an episode [control steps]; none: the scenario's.
        seed: seed of the episodes until `reset` is given one; none: a random one.
        num_threads: as of `BatchEnv`.
        first_env: as of `BatchEnv`.
        overrides: fields of `Scenario` to change.

    Raises:
        ConfigError: unknown preset, field, form, autoreset or render mode, or an invalid value.
        TypeError, ValueError: another value of another type, or out of range.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012  (as the base has it)
        "render_modes": usable_modes(_MODES),
        "render_fps": STEPS_PER_SECOND,
        "autoreset_mode": AutoresetMode.NEXT_STEP,
    }

    def __init__(
        self,
        num_envs: int = 1,
        scenario: Scenario | str = "mixed",
        *,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        copy: bool = True,
        form: Form = "joint",
        render_mode: str | None = None,
        max_episode_steps: int | None = None,
        seed: int | None = None,
        num_threads: int | None = None,
        first_env: int = 0,
        **overrides: Any,
    ) -> None:
        if not isinstance(copy, bool):
            raise TypeError(f"copy = {copy!r}: must be True or False")
        scenario = chosen_scenario(scenario, max_episode_steps, "max_episode_steps", overrides)
        self._mode = _known_mode(autoreset_mode)
        self.metadata = {**self.metadata, "autoreset_mode": self._mode}
        self.scenario = scenario
        self.render_mode = render_mode
        self._screen = Screen(render_mode, _MODES)
        self._form = TeamForm(scenario, form)
        self._env = BatchEnv(
            scenario,
            num_envs,
            seed_or_random(seed),
            num_threads,
            autoreset=_AUTORESET[self._mode],
            copy=False,
            first_env=first_env,
        )
        self._copy = copy
        self._started = False
        self.num_envs = self._env.num_envs
        self.single_observation_space = self._form.observation_space
        self.single_action_space = self._form.action_space
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self.single_state_space = state_space(scenario)
        self.state_space = batch_space(self.single_state_space, self.num_envs)

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Any, Infos]:
        """Start new episodes.

        Args:
            seed: seed of all worlds, which differ by their number; or a seed, or None, for each.
            options: "reset_mask" may hold the worlds to reset, (E,) bool, at least one.

        Raises:
            gymnasium.error.ResetNeeded: a mask at the first reset, which is of all worlds.
            TypeError, ValueError: a seed or mask that is not allowed; nothing has changed then.
        """
        mask = self._reset_mask((options or {}).get("reset_mask"))
        seeds = None if seed is None or isinstance(seed, (int, np.integer)) else _listed(seed)
        if seeds is not None and len(seeds) != self.num_envs:
            raise ValueError(f"seed has {len(seeds)} values: must be {self.num_envs}, one an env")
        for index, one in enumerate(seeds or ()):
            if one is not None:
                whole_number(f"seed[{index}]", one, 0, MOST_SEED)
        if seeds is None:
            super().reset(seed=None if seed is None else int(seed))  # type: ignore[arg-type]
            obs = self._env.reset(seed, mask)  # type: ignore[arg-type]
        else:
            obs = self._reset_each(seeds, np.ones(self.num_envs, bool) if mask is None else mask)
        self._started = True
        return self._form.observed(obs), {}

    def step(self, actions: Any) -> tuple[Any, NDArray[np.float64], Flags, Flags, Infos]:
        """Let all teams act for one control step.

        Args:
            actions: (E, R) integers, or (E, R, 2) floats where they are continuous; in the form
                "agents" a dict by robot of (E,) or (E, 2).

        Raises:
            gymnasium.error.ResetNeeded: there was no reset yet.
            TypeError, ValueError, WorldError: as of `BatchEnv.step`.
        """
        if not self._started:
            raise ResetNeeded("no episode has started: call reset() before step()")
        step = self._env.step(self._form.actions(actions, batch_axes=1))
        rewards = team_rewards(step.reward)
        infos = self._infos(step)
        if self._copy:
            obs = self._form.observed(step.obs)
            return obs, rewards, step.terminated.copy(), step.truncated.copy(), infos
        return self._form.lent(step.obs), rewards, step.terminated, step.truncated, infos

    def state(self) -> NDArray[np.float32]:
        """The whole of each world, (E, S) float32; `BatchEnv.state` has the columns."""
        return self._env.state()

    def render(self) -> tuple[Any, ...] | None:
        """A picture (H, W, 3) of each world, or none where `render_mode` is none."""
        if self.render_mode is None:
            return None
        return tuple(self._screen.show(self._env, world) for world in range(self.num_envs))

    def close_extras(self, **_: Any) -> None:
        """Free the worlds; the environment cannot be used afterwards."""
        self._env.close()

    def _reset_mask(self, mask: Any) -> Flags | None:
        """The worlds to reset, as `SyncVectorEnv` checks them; none for all."""
        if mask is None:
            return None
        place = "options['reset_mask']"
        wanted = f"must be a bool array of shape ({self.num_envs},) with at least one True"
        if not isinstance(mask, np.ndarray) or mask.dtype != np.bool_:
            found = f"has dtype {mask.dtype}" if isinstance(mask, np.ndarray) else "is no array"
            raise TypeError(f"{place} {found}: {wanted}")
        if mask.shape != (self.num_envs,) or not mask.any():
            found = "is all False" if mask.shape == (self.num_envs,) else f"has shape {mask.shape}"
            raise ValueError(f"{place} {found}: {wanted}")
        if not self._started and not mask.all():
            raise ResetNeeded("no episode has started: the first reset() is of all envs")
        return mask

    def _reset_each(self, seeds: list[int | None], mask: Flags) -> NDArray[np.float32]:
        """Reset the worlds of a mask, each with its own seed."""
        obs = self._env.observe()
        for seed in dict.fromkeys(seed for seed, chosen in zip(seeds, mask, strict=True) if chosen):
            same = np.array([other == seed for other in seeds])
            obs = self._env.reset(seed, same & mask)
        return obs

    def _infos(self, step: Step) -> Infos:
        """What `SyncVectorEnv` makes of the infos of single worlds."""
        found: dict[str, NDArray[Any]] = {
            "robot_rewards": step.reward,
            "rescues": np.bincount(step.rescues["env"], minlength=self.num_envs),
        }
        if self._env.scenario.has_deadlines:
            found["lost"] = np.bincount(self._env.lost()["env"], minlength=self.num_envs)
        if self._env.scenario.has_arrivals:
            found["turned_away"] = self._env.turned_away()
        if self._mode is AutoresetMode.NEXT_STEP:
            begun = self._env.step_counts() == 0  # they were reset and did not act
            return _masked(found, ~begun, self._copy)
        ended = step.terminated | step.truncated
        if self._mode is AutoresetMode.DISABLED or not ended.any():
            return _masked(found, np.ones(self.num_envs, bool), self._copy)
        final_obs = np.full(self.num_envs, None, dtype=object)
        for world, rows in zip(np.flatnonzero(ended), step.final_obs[ended], strict=True):
            final_obs[world] = self._form.lent(rows)
        return {
            "final_obs": final_obs,
            "_final_obs": ended,
            "final_info": _masked(found, ended, self._copy),
            "_final_info": ended.copy(),
            **_masked(found, ~ended, self._copy),
        }


def _known_mode(mode: AutoresetMode | str) -> AutoresetMode:
    """Gymnasium's mode by itself or by its value."""
    try:
        return AutoresetMode(mode)
    except ValueError:
        known = " or ".join(repr(one.value) for one in AutoresetMode)
        raise ConfigError(f"autoreset_mode = {mode!r}: must be {known}") from None


def _listed(seeds: Any) -> list[int | None]:
    """Seeds of each world as a list."""
    if isinstance(seeds, str) or not hasattr(seeds, "__iter__"):
        wanted = "must be an integer, None, or a list with one of them for each env"
        raise TypeError(f"seed = {seeds!r}: {wanted}")
    return list(seeds)


def _masked(found: dict[str, NDArray[Any]], mask: Flags, copy: bool) -> Infos:
    """Arrays of what the worlds of a mask said, zero for all others, and the mask of each."""
    infos: Infos = {}
    if mask.all():
        for name, values in found.items():
            infos[name] = values.copy() if copy else values
            infos[f"_{name}"] = mask.copy()
    elif mask.any():
        for name, values in found.items():
            chosen = mask.reshape(-1, *(1,) * (values.ndim - 1))
            infos[name] = np.where(chosen, values, np.zeros((), values.dtype))
            infos[f"_{name}"] = mask.copy()
    return infos
