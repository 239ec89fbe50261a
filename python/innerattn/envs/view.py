"""What the views of rescue worlds share: the scenario that was asked for, seeds, and pictures."""

from __future__ import annotations

from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from innerattn.config.scenario import Scenario
from innerattn.envs.render import draw_world, paint_figure, positions_of
from innerattn.envs.window import Window
from innerattn.errors import ConfigError, MissingLibraryError

if TYPE_CHECKING:
    from innerattn.envs.batch import BatchEnv

STEPS_PER_SECOND = 10
"""Pictures per second, as many as there are control periods by default."""


def chosen_scenario(
    scenario: Scenario | str, steps: int | None, steps_name: str, overrides: dict[str, Any]
) -> Scenario:
    """The scenario that a caller of a view asked for.

    Args:
        scenario: the world, or the name of a preset.
        steps: length of an episode [control steps]; none: the scenario's.
        steps_name: what the view calls ``steps``.
        overrides: fields of `Scenario` to change.

    Raises:
        ConfigError: unknown preset or field, or an invalid value.
        TypeError: ``scenario`` is of another type.
    """
    if not isinstance(scenario, (Scenario, str)):
        raise TypeError(f"scenario = {scenario!r}: must be a Scenario or the name of a preset")
    if isinstance(scenario, str):
        scenario = Scenario.preset(scenario)
    if steps is not None:
        if "episode_steps" in overrides:
            raise ConfigError(f"{steps_name} and episode_steps are the same: give one of them")
        overrides = overrides | {"episode_steps": steps}
    return scenario.replace(**overrides) if overrides else scenario


def seed_or_random(seed: int | None) -> int:
    """The seed, or a random one where there is none."""
    return int(np.random.default_rng().integers(2**63)) if seed is None else seed


def usable_modes(modes: list[str]) -> list[str]:
    """Those ways to show worlds that work here: all, or none without Matplotlib."""
    return modes if find_spec("matplotlib") is not None else []


class Screen:
    """Shows single worlds of a batch: as arrays, in a window, or not at all.

    Args:
        mode: none, "rgb_array" or "human".
        modes: what is allowed beside none.

    Raises:
        ConfigError: another mode.
        MissingLibraryError: Matplotlib is not installed.
    """

    def __init__(self, mode: str | None, modes: list[str]) -> None:
        if mode not in (None, *modes):
            known = " or ".join(repr(one) for one in modes)
            raise ConfigError(f"render_mode = {mode!r}: must be None or {known}")
        if mode is not None and find_spec("matplotlib") is None:
            raise MissingLibraryError(
                f"render_mode = {mode!r} needs matplotlib: pip install 'innerattn[report]'"
            )
        self.mode = mode
        self._modes = modes
        self._window: Window | None = None

    def __reduce__(self) -> tuple[Any, ...]:
        """For pickle: a copy opens a window of its own."""
        return Screen, (self.mode, self._modes)

    def show(self, env: BatchEnv, world: int = 0) -> NDArray[np.uint8] | None:
        """The picture of a world, (H, W, 3); none where it goes to the window or nowhere."""
        if self.mode is None:
            return None
        drawn = (
            positions_of(env.positions()[world], env.present()[world]),
            env.velocities()[world],
            env.victims()[world],
            env.obstacles()[world],
            env.headings()[world],
        )
        step = int(env.step_counts()[world])
        title = f"step {step} of {env.scenario.episode_steps}"
        if self.mode == "rgb_array":
            return draw_world(env.scenario, *drawn, step=step, title=title)
        if self._window is None:
            self._window = Window(f"innerattn, {env.scenario.situation}", STEPS_PER_SECOND)
        self._window.update(
            lambda figure: paint_figure(figure, env.scenario, *drawn, step=step, title=title)
        )
        return None

    def follow(self, env: BatchEnv) -> None:
        """After a reset or a step: shows the world where somebody watches."""
        if self.mode == "human":
            self.show(env)

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._window is not None:
            self._window.close()
            self._window = None
