"""What is known of a world at one moment, and of the step that led to it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class Rescue(NamedTuple):
    """A rescue: the step in which it happened, the victim, its task, and who helped."""

    step: int
    victim: int
    task: int
    helpers: tuple[int, ...]


class Loss(NamedTuple):
    """A victim that was lost: the step in which it was, the victim, and its task."""

    step: int
    victim: int
    task: int


class Handoff(NamedTuple):
    """A robot's partners in two rescues of different tasks that follow each other, and steps."""

    robot: int
    before: int
    after: int
    first: int
    second: int


@dataclass(frozen=True)
class Moment:
    """A world now, and what happened in the step that led to it.

    Attributes:
        episode: number of the episode, from 0.
        step: steps done in it.
        policy: name of the policy that acts.
        steered: the robot that a person steers; none: the policy drives all.
        positions: (R, 2) float32 [m].
        velocities: (R, 2) float32 [m/s].
        victims: (V,) structured, the fields of `BatchEnv.victims`.
        faults: (R,) structured, the fields of `BatchEnv.fault_state`.
        headings: (R, 2) float32, angles [rad] and turn rates [rad/s]; none: no robot has any.
        charge: (R,) float32, shares of batteries; none: no robot has one.
        load: (R,) float32, shares of full loads; none: no robot has one.
        heard: (R, R) bool, robot i hears robot j; none: nothing limits communication.
        rays: (R, K) float32, readings of range sensors, 1 - distance / range; none: there is none.
        obstacles: (O, 2) float32 [m].
        blocked: (R,) bool, whether something stopped the robot in the last step.
        attention: (H, R, R) float32 for the actions that come next; none: there is none.
        rescues: of the last step.
        lost: victims that were lost in the last step.
        handoffs: that were completed in the last step.
        rescued: victims rescued in this episode.
        helped: (R,) rescues of this episode in which each robot helped.
    """

    episode: int
    step: int
    policy: str
    steered: int | None
    positions: NDArray[np.float32]
    velocities: NDArray[np.float32]
    victims: NDArray[np.void]
    faults: NDArray[np.void]
    headings: NDArray[np.float32] | None
    charge: NDArray[np.float32] | None
    load: NDArray[np.float32] | None
    heard: NDArray[np.bool_] | None
    rays: NDArray[np.float32] | None
    obstacles: NDArray[np.float32]
    blocked: NDArray[np.bool_]
    attention: NDArray[np.float32] | None
    rescues: tuple[Rescue, ...]
    lost: tuple[Loss, ...]
    handoffs: tuple[Handoff, ...]
    rescued: int
    helped: tuple[int, ...]
