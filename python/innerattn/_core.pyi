"""Types and shapes of the compiled half of innerattn. Use it through `innerattn.envs.BatchEnv`."""

from typing import final

import numpy as np
from numpy.typing import NDArray

__all__ = ["Batch", "__version__", "check_scenario"]

__version__: str

def check_scenario(json: str) -> str:
    """Check a scenario in JSON and return it with every key written out.

    Raises:
        ValueError: one line naming the key, its value and what is allowed.
    """

@final
class Batch:
    """Many rescue worlds of one scenario. E envs, R robots, D columns, V victim slots, O obstacles.

    Arrays returned by `step` and `reward_components` are read-only and valid until the step after
    next; all others are fresh. Not to be used from two threads at once (RuntimeError), nor, with
    several threads, in a child process after a fork (RuntimeError).
    """

    def __new__(
        cls,
        scenario_json: str,
        num_envs: int,
        seed: int,
        num_threads: int | None,
        first_env: int,
        autoreset: bool,
    ) -> Batch: ...
    @property
    def num_threads(self) -> int:
        """Threads in use."""

    @property
    def obs_width(self) -> int:
        """Columns D of an observation."""

    def observation_names(self) -> list[str]:
        """Names of the D columns; units are m and m/s."""

    @staticmethod
    def reward_component_names() -> list[str]:
        """Names of the reward components."""

    def reset(self, seed: int | None, mask: NDArray[np.bool_] | None) -> NDArray[np.float32]:
        """Start new episodes in the worlds of `mask` (E,); returns observations (E, R, D)."""

    def step(
        self, actions: NDArray[np.integer] | NDArray[np.floating]
    ) -> tuple[
        NDArray[np.float32],
        NDArray[np.float32],
        NDArray[np.bool_],
        NDArray[np.bool_],
        NDArray[np.float32],
        NDArray[np.void],
    ]:
        """Do one control step; actions are (E, R) integers, or (E, R, 2) floats when continuous.

        Returns:
            obs (E, R, D), reward (E, R), terminated (E,), truncated (E,), final_obs (E, R, D), and
            rescues (n,) structured int64: env, episode, step, slot, victim, task, helper_0, ...
            (-1 for none).

        Raises:
            TypeError: wrong dtype.
            ValueError: wrong shape, an action out of range or not a number (env and robot are
                named), or a world whose episode is over. Nothing has moved then.
        """

    def reward_components(self) -> NDArray[np.float32]:
        """Rewards of the last step by component, (E, R, 4)."""

    def observe(self) -> NDArray[np.float32]:
        """Present observations, (E, R, D)."""

    def positions(self) -> NDArray[np.float32]:
        """Places of the robots, (E, R, 2), m."""

    def velocities(self) -> NDArray[np.float32]:
        """Velocities of the robots, (E, R, 2), m/s."""

    def obstacles(self) -> NDArray[np.float32]:
        """Centres of the obstacles, (E, O, 2), m."""

    def victims(self) -> tuple[NDArray[np.int64], NDArray[np.float32]]:
        """Victims as (E, V, 4) present, task, id, appeared_step and (E, V, 2) places, m."""

    def step_counts(self) -> NDArray[np.int64]:
        """Steps done in each env's episode, (E,)."""

    def episodes(self) -> NDArray[np.int64]:
        """Each env's episode, from 0, (E,)."""

    def set_motion(self, positions: NDArray[np.float32], velocities: NDArray[np.float32]) -> None:
        """Put the robots at positions (E, R, 2), m, with velocities (E, R, 2), m/s."""

    @staticmethod
    def fault_kinds() -> list[str]:
        """Names of the kinds of faults, in the order of levels."""

    def fault_state(self) -> NDArray[np.float32]:
        """Levels of the faults in effect, (E, R, kinds)."""

    def set_faults(self, levels: NDArray[np.float32], mask: NDArray[np.bool_] | None) -> None:
        """Put levels (E, R, kinds) in place of the scenario's faults in the worlds of `mask` (E,).

        Raises:
            ValueError: wrong shape, or a level out of range (kind, env and robot are named).
                Nothing has changed then.
        """

    def snapshot(self) -> bytes:
        """Image of all worlds, with a checksum."""

    def restore(self, image: bytes) -> None:
        """Put all worlds back into an image's state; ValueError, and no change, if refused."""
