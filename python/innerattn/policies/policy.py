"""What a policy sees and gives; the one protocol of scripts, trained teams and exported actors."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple, Protocol, Self, runtime_checkable

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from innerattn.envs import BatchEnv


class WorldState(NamedTuple):
    """The true state of a batch of worlds.

    Attributes:
        positions: (E, R, 2) float32 [m].
        velocities: (E, R, 2) float32 [m/s].
        victims: (E, V) structured, the fields of `BatchEnv.victims`.
        faults: (E, R) structured, the fields of `BatchEnv.fault_state`.
        step_counts: (E,) int64 steps done in the episodes; deadlines are counted in them.
        charge: (E, R) float32 charges as shares; None where no robot has a battery.
        load: (E, R) float32 loads as shares; None where no robot has one.
        last_seen: (E, R, R + V) int64, see `BatchEnv.last_seen`; None where no sight is limited.
        headings: (E, R, 2) float32, angles [rad] and turn rates [rad/s] of robots on wheels; None
            where no robot has a heading.
        obstacles: (E, O, 2) float32 [m]; None where nothing stands in the way.
    """

    positions: NDArray[np.float32]
    velocities: NDArray[np.float32]
    victims: NDArray[np.void]
    faults: NDArray[np.void]
    step_counts: NDArray[np.int64]
    charge: NDArray[np.float32] | None = None
    load: NDArray[np.float32] | None = None
    last_seen: NDArray[np.int64] | None = None
    headings: NDArray[np.float32] | None = None
    obstacles: NDArray[np.float32] | None = None

    @classmethod
    def of(cls, env: BatchEnv) -> Self:
        """The present state of the worlds of ``env``."""
        return cls(
            env.positions(),
            env.velocities(),
            env.victims(),
            env.fault_state(),
            env.step_counts(),
            env.charge() if env.scenario.has_batteries else None,
            env.load() if env.scenario.has_loads else None,
            env.last_seen() if env.scenario.has_limited_sight else None,
            pointing(env),
            env.obstacles() if env.scenario.blocks_ways else None,
        )


def pointing(env: BatchEnv) -> NDArray[np.float32] | None:
    """Angles [rad] and turn rates [rad/s] of robots, (E, R, 2); None where none has a heading."""
    if not env.scenario.has_wheels:
        return None
    return np.stack([env.headings(), env.turn_rates()], -1)


class PolicyInput(NamedTuple):
    """What a policy sees before it acts.

    Attributes:
        obs: (E, R, D) float32, the robots' observations.
        state: the true state; None where the policy says that it does not need it.
    """

    obs: NDArray[np.float32]
    state: WorldState | None = None

    @property
    def known_state(self) -> WorldState:
        """The true state, for policies that need it.

        Raises:
            ValueError: it was not given.
        """
        if self.state is None:
            raise ValueError("state = None: must be given to a policy with needs_true_state")
        return self.state


class Policy(Protocol):
    """Anything that drives a team."""

    @property
    def name(self) -> str:
        """What to call it in tables."""

    @property
    def needs_true_state(self) -> bool:
        """Whether `act` looks at `PolicyInput.state`, which is fetched only then."""

    def act(self, view: PolicyInput) -> NDArray[Any]:
        """Choose actions: (E, R) integers, or (E, R, 2) float32 where actions are continuous."""

    def reset(self, seed: int) -> None:
        """Forget what was seen; all that is drawn from now on follows from ``seed`` alone."""


@runtime_checkable
class RememberingPolicy(Protocol):
    """A policy that remembers what it saw in an episode; `Policy.act` is one step of the worlds."""

    def forget(self) -> None:
        """Begin new episodes in all worlds, of whatever number; draws go on."""
