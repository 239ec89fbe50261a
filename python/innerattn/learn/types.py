"""The data that a learner exchanges with whatever drives it, and the contract it keeps."""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

import torch
from torch import Tensor

from innerattn.config import NetworkConfig
from innerattn.nn import EntityColumns


class Team(NamedTuple):
    """What a learner knows of a team.

    Attributes:
        num_robots: R.
        obs_width: D, columns of one robot's observation.
        num_actions: A, discrete actions of one robot.
        kinds: Kind of each robot, R words; needed only where `network.parameter_sharing` is "kind".
        availability_column: Column of a robot's observation that says whether the robot is
            available (above 0.5); needed only where `network.mask_unavailable` is set.
        entities: To whom the columns of an observation belong; needed only where `network.encoder`
            is "entities".
    """

    num_robots: int
    obs_width: int
    num_actions: int
    kinds: tuple[str, ...] | None = None
    availability_column: int | None = None
    entities: EntityColumns | None = None


class Transitions(NamedTuple):
    """B transitions of the whole team.

    Attributes:
        obs: (B, R, D) float32.
        actions: (B, R) int64.
        reward: (B, R) float32.
        next_obs: (B, R, D) float32, the observation after the step, before any reset.
        terminated: (B,) bool; a time limit is not a termination.
    """

    obs: Tensor
    actions: Tensor
    reward: Tensor
    next_obs: Tensor
    terminated: Tensor


class Learner(Protocol):
    """A policy that improves from what it is shown.

    Attributes:
        actor_frozen: While set, `learn` trains all but the policy, which others may change by
            `imitate`; to be set before `observe`.
    """

    actor_frozen: bool

    def act(self, obs: Tensor, greedy: bool = False) -> Tensor:
        """Choose actions.

        Args:
            obs: (E, R, D) float32.
            greedy: Take the likeliest action instead of drawing one.

        Returns:
            (E, R) int64, on the device of `obs`.
        """

    def observe(self, batch: Transitions, truncated: Tensor) -> None:
        """Take in one control step of E worlds.

        Args:
            batch: The E transitions.
            truncated: (E,) bool, episodes that a time limit ended.
        """

    def imitate(self, obs: Tensor, actions: Tensor, learning_rate: float) -> float:
        """Do one step of Adam of the policy towards given actions.

        The step goes down the cross-entropy -mean_b log pi_i(a_bi | o_bi), summed over robots i.

        Args:
            obs: (B, R, D) float32.
            actions: (B, R) int64.
            learning_rate: Step size.

        Returns:
            The cross-entropy before the step, its mean over robots [nats].
        """

    def set_progress(self, share: float) -> None:
        """Take note of how far training is; whatever changes over a run follows it.

        Args:
            share: Part of the run that is done, 0 to 1.
        """

    def learn(self) -> dict[str, float] | None:
        """Do the updates that are due.

        Returns:
            Means over these updates, by name; None when none was due.
        """

    @property
    def updates(self) -> int:
        """Number of updates done so far."""

    def compile(self) -> None:
        """Do updates as one compiled graph from now on; the first ones wait for the compiler.

        Results are those of uncompiled updates but for rounding.
        """

    def attention(self, obs: Tensor, actions: Tensor) -> Tensor | None:
        """Attention weights of the critic.

        Args:
            obs: (B, R, D) float32.
            actions: (B, R) int64.

        Returns:
            (B, H, R, R): row i holds robot i's weights over its teammates; the diagonal is 0. None
            where the critic has no attention.
        """

    def state(self) -> dict[str, Tensor]:
        """Everything learnt, as copies under flat names."""

    def load(self, state: dict[str, Tensor]) -> None:
        """Take over what `state` returned.

        Raises:
            ValueError: A name, shape or dtype is wrong; the learner is left unchanged.
        """


class LearnerClass(Protocol):
    """How a registered learner is built; see `innerattn.config.Algorithm.learner`."""

    def __call__(
        self,
        team: Team,
        network: NetworkConfig,
        config: Any,
        *,
        seed: int,
        device: torch.device,
    ) -> Learner:
        """Build a learner with initial weights.

        Args:
            team: What is known of the team.
            network: Sizes and kind of the networks.
            config: The algorithm's section, an instance of `innerattn.config.Algorithm.config`.
            seed: Seed of the initial weights and of every draw.
            device: Where the networks live.

        Raises:
            ValueError: The team lacks something that the configuration needs.
        """
