"""The protocol of a learner, and the data that it exchanges with the training loop."""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol, runtime_checkable

import torch
from torch import Tensor

from innerattn.config import NetworkConfig
from innerattn.learn.interruptions import Interruptions
from innerattn.learn.resume import State
from innerattn.learn.ring import Ring
from innerattn.nn import (
    Actions,
    DiscreteActions,
    EntityColumns,
    Hearing,
    PartnerColumns,
    SquashedActions,
)


class Team(NamedTuple):
    """What a learner knows of a team.

    Attributes:
        num_robots: R.
        obs_width: D, columns of one robot's observation.
        num_actions: A, discrete actions of one robot; 0 where actions are continuous.
        kinds: Kind of each robot, R words; needed only where `network.parameter_sharing` is "kind".
        availability_column: Column of a robot's observation that says whether the robot is
            available (above 0.5); needed only where `network.mask_unavailable` is set.
        entities: To whom the columns of an observation belong; needed only where `network.encoder`
            is "entities".
        partners: The columns of an observation that tell who can help whom; needed only where
            `network.attention` is "oracle".
        action_width: W, numbers of a continuous action; 0 where actions are discrete.
        state_width: S, columns of the state of a world; needed only where `ppo.bootstrap` is
            "afterstate".
        swapped: Two robots that swap their initial weights; None: none do.
        terminates: Whether an episode may terminate, so that a policy decides how long it lasts.
        hearing: How observations say whom a robot hears; needed only where `network.message_width`
            is not 0.
        able: Columns of a robot's observation that are all above 0 where it can act; needed only
            where `network.mask_actions` is set.
    """

    num_robots: int
    obs_width: int
    num_actions: int
    kinds: tuple[str, ...] | None = None
    availability_column: int | None = None
    entities: EntityColumns | None = None
    partners: PartnerColumns | None = None
    action_width: int = 0
    state_width: int = 0
    swapped: tuple[int, int] | None = None
    terminates: bool = False
    hearing: Hearing | None = None
    able: tuple[int, ...] = ()

    @property
    def actions(self) -> Actions:
        """The kind of actions of one robot."""
        if self.action_width:
            return SquashedActions(self.action_width)
        return DiscreteActions(self.num_actions)


class Scheduled(NamedTuple):
    """What a run's schedule says at one moment; None where it says nothing.

    Attributes:
        gamma: Discount of a control step.
        entropy_weight: Weight of the policy's entropy.
        reward_weights: (P,) float32, weights of `Transitions.reward_parts`.
    """

    gamma: float | None = None
    entropy_weight: float | None = None
    reward_weights: Tensor | None = None


class Afterstates(NamedTuple):
    """The n worlds in which victims appeared with a control step, without these victims.

    Attributes:
        env: (n,) int64, numbers of the worlds, whose episodes all go on.
        states: (n, S) float32.
    """

    env: Tensor
    states: Tensor


class Transitions(NamedTuple):
    """B transitions of the whole team.

    Attributes:
        obs: (B, R, D) float32.
        actions: (B, R) int64, or (B, R, W) float32 where actions are continuous, as everywhere.
        reward: (B, R) float32.
        next_obs: (B, R, D) float32, the observation after the step, before any reset.
        terminated: (B,) bool; a time limit is not a termination.
        reward_parts: (B, R, P) float32, whose weighted sum the reward is; None if the run weighs
            no rewards. A learner that remembers rewards weighs them anew.
        afterstates: Of the worlds in which victims appeared; None if the learner asks for none.
        elements: (B, R) int64, elements that turned the worlds into the frames of `obs`; None: they
            are not turned. What robots remember turns with them.
        next_elements: (B, R) int64, likewise of `next_obs`.
    """

    obs: Tensor
    actions: Tensor
    reward: Tensor
    next_obs: Tensor
    terminated: Tensor
    reward_parts: Tensor | None = None
    afterstates: Afterstates | None = None
    elements: Tensor | None = None
    next_elements: Tensor | None = None


class Learner(Protocol):
    """A policy that acts, and improves from transitions.

    Attributes:
        actor_frozen: While set, `learn` does not train the policy, and `imitate` may; to be set
            before `observe`.
    """

    actor_frozen: bool

    def act(self, obs: Tensor, greedy: bool = False) -> Tensor:
        """Choose actions.

        Args:
            obs: (E, R, D) float32.
            greedy: Take the likeliest action instead of drawing one; tanh of the mean where actions
                are continuous.

        Returns:
            (E, R) int64, or (E, R, W) float32 in [-1, 1], on the device of `obs`.
        """

    def seed_draws(self, seed: int) -> None:
        """Let the actions that are drawn from now on follow from ``seed`` alone."""

    def observe(self, batch: Transitions, truncated: Tensor) -> None:
        """Store one control step of E worlds.

        Args:
            batch: The E transitions.
            truncated: (E,) bool, episodes that a time limit ended.
        """

    def imitate(self, obs: Tensor, actions: Tensor, learning_rate: float) -> float:
        """Train the policy to take given actions, by one step of Adam.

        The loss is the cross-entropy -mean_b log pi_i(a_bi | o_bi), summed over robots i.

        Args:
            obs: (B, R, D) float32.
            actions: (B, R) int64.
            learning_rate: Learning rate of this step.

        Returns:
            The cross-entropy before the step, its mean over robots [nats].
        """

    def set_progress(self, share: float) -> None:
        """Set how far training is, for what changes over a run, such as the learning rate.

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
        """Do updates as one compiled graph from now on; the first updates wait for the compiler.

        Results differ from those of uncompiled updates only by rounding.
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
        """Copies of everything learnt, by name."""

    def load(self, state: dict[str, Tensor]) -> None:
        """Restore what `state` returned.

        Raises:
            ValueError: A name, shape or dtype is wrong; the learner is left unchanged.
        """


@runtime_checkable
class ActorAttention(Protocol):
    """A learner whose actors may attend to their teammates."""

    def actor_attention(self, obs: Tensor) -> Tensor | None:
        """The weights with which actors sum up their teammates.

        Args:
            obs: (B, R, D) float32, in which each row has all teammates in their order.

        Returns:
            (B, H, R, R): row i holds robot i's weights over its teammates; the diagonal is 0. None
            where actors sum up no teammates by attention, and where they remember or hear messages.
        """


@runtime_checkable
class ScheduledLearner(Protocol):
    """A learner that can follow a schedule of its run (`train.schedule`)."""

    def follow(self, scheduled: Scheduled) -> None:
        """Take over numbers, for what is observed and learnt from now on."""


@runtime_checkable
class SkippingLearner(Protocol):
    """A learner that can leave out updates that are not finite (`train.on_divergence`).

    Attributes:
        skips_divergence: Leave them out, and count them as "skipped_updates" among what `learn`
            returns, instead of raising a `DivergenceError`.
    """

    skips_divergence: bool


@runtime_checkable
class RememberingLearner(Protocol):
    """A learner whose robots may remember what they saw earlier in their episodes.

    `act` is one step of the worlds: what robots see there, they remember. `Learner.observe` tells
    in which worlds episodes ended; whoever calls `act` alone says so by `forget`.
    """

    def act(self, obs: Tensor, greedy: bool = False, elements: Tensor | None = None) -> Tensor:
        """As `Learner.act`; ``elements`` as in `Transitions`."""

    def forget(self) -> None:
        """Begin new episodes in all worlds, of whatever number."""

    def remembered(self) -> Tensor | None:
        """What robots remembered before they saw what `act` was called with last.

        Returns:
            (E, R, M) of the networks' type; None for networks without a memory.
        """

    def attention(
        self,
        obs: Tensor,
        actions: Tensor,
        remembered: Tensor | None = None,
        elements: Tensor | None = None,
    ) -> Tensor | None:
        """As `Learner.attention`.

        Args:
            obs: (B, R, D) float32.
            actions: (B, R) int64.
            remembered: (B, R, M) what robots remembered before; None: what `remembered` gives.
            elements: As in `Transitions`.
        """


@runtime_checkable
class ResumableLearner(Protocol):
    """A learner whose training can go on in another process, to the bit.

    `learn` asks `interruptions` between two updates. Where that raises, no update is half done, and
    the next call of `learn` does the rest, in this process or, after a checkpoint, in another one.

    Attributes:
        interruptions: Says that training is to stop.
    """

    interruptions: Interruptions

    def rings(self) -> dict[str, Ring]:
        """Large memories by name, which checkpoints store by what is new in them."""

    def resume_state(self) -> dict[str, Tensor]:
        """All else that `Learner.state` does not have: what is collected, random generators."""

    def load_resume_state(self, state: State) -> None:
        """Go on from what `resume_state` gave, once `Learner.load` and the rings are filled.

        Raises:
            ValueError: The state is not that of an equal learner.
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
