"""On-policy learning ("ppo"): its numbers and what it registers."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, ClassVar, Literal

from pydantic import Field

from innerattn.config.algorithm import Algorithm, AlgorithmConfig
from innerattn.config.files import PRESETS
from innerattn.config.model import ADDED_LATER, MOST_ROWS


class PPOConfig(AlgorithmConfig):
    """On-policy learning by proximal policy optimisation."""

    place: ClassVar[str] = "ppo"
    remembers: ClassVar[bool] = True
    speaks: ClassVar[bool] = True
    removed: ClassVar[Mapping[str, object]] = {"value_clip": None}

    gae_lambda: float = Field(
        0.9, ge=0.0, le=1.0, description="horizon of advantages: 0 is one step, 1 the whole episode"
    )
    learning_rate: float = Field(0.003, gt=0.0, le=1.0, description="step size of Adam")
    final_learning_rate_share: float = Field(
        0.1,
        ge=0.0,
        le=1.0,
        description="share of the step size left at the end of training; it falls linearly",
    )
    rollout_steps: int = Field(
        25, ge=1, le=MOST_ROWS, description="control steps of every world between updates [steps]"
    )
    epochs: int = Field(5, ge=1, le=1_000, description="passes over a rollout")
    minibatch_size: int = Field(400, ge=1, le=MOST_ROWS, description="rows of a rollout per update")
    clip: float = Field(
        0.2, gt=0.0, lt=1.0, description="largest change of a probability ratio that counts"
    )
    entropy_weight: float = Field(0.01, ge=0.0, description="weight of the policy's entropy")
    stop_at_kl: float | None = Field(
        None,
        gt=0.0,
        description="KL divergence that ends a rollout's epochs [nats]; None: none does",
    )
    advantage: Literal["counterfactual", "value"] = Field(
        "counterfactual",
        description="baseline: expectation of Q over the robot's own actions, or a value head; "
        "mappo and continuous actions need the value head",
    )
    bootstrap: Annotated[Literal["state", "afterstate"], ADDED_LATER] = Field(
        "state",
        description="what the value after a step is of: the next state, or that state before it is "
        "drawn where new victims appear",
    )
    afterstate_epochs: Annotated[int | None, ADDED_LATER] = Field(
        None,
        ge=1,
        le=1_000,
        description="passes over a rollout's afterstates; None: as many as over the rollout",
    )
    sequence_steps: Annotated[int, ADDED_LATER] = Field(
        5,
        ge=1,
        le=MOST_ROWS,
        description="control steps that gradients of a memory (network.memory_width) go back; "
        "must then divide rollout_steps [steps]",
    )
    attention_logit_penalty: float = Field(
        0.0,
        ge=0.0,
        description="weight of attention-logit regularisation (mean squared logits) in the "
        "critic's loss",
    )
    critic_weight_decay: float = Field(0.0, ge=0.0, description="L2 penalty of the critic's Adam")
    critic_grad_clip: float = Field(40.0, gt=0.0, description="largest norm of critic gradients")
    actor_grad_clip: float = Field(0.5, gt=0.0, description="largest norm of an actor's gradients")
    return_deviation_floor: float = Field(
        1e-2, gt=0.0, description="least standard deviation of returns that rewards are divided by"
    )

    def check_memory(self) -> None:
        """Check that a rollout is made of whole sequences."""
        if self.rollout_steps % self.sequence_steps:
            raise ValueError(
                f"ppo.sequence_steps = {self.sequence_steps}: must divide ppo.rollout_steps = "
                f"{self.rollout_steps}"
            )

    @property
    def needs_afterstates(self) -> bool:
        """Whether values after a step are those of afterstates."""
        return self.bootstrap == "afterstate"

    @property
    def rows_per_update(self) -> int:
        """Rows of a minibatch."""
        return self.minibatch_size

    def rows_of_training(self, env_steps: int) -> int:
        """Rows of all passes over all rollouts."""
        return env_steps * self.epochs


PPO = Algorithm(
    config=PPOConfig,
    learner="innerattn.learn.ppo:PPO",
    attends=True,
    averages_over_workers=True,
    methods={
        "mappo": {
            "network": {"attention": "none", "mask_unavailable": False, "encoder": "flat"},
            "ppo": {"advantage": "value"},
        }
    },
    continuous={"ppo": {"advantage": "value"}, "train": {"warm_start": "none"}},
    budgets=PRESETS / "budgets" / "ppo",
    warm_budgets=PRESETS / "budgets" / "ppo-warm",
)
