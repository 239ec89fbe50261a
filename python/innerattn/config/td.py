"""Off-policy actor-critic learning ("td"): its numbers and what it registers."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar, Literal, Self

from pydantic import Field, model_validator

from innerattn.config.algorithm import Algorithm, AlgorithmConfig
from innerattn.config.model import MOST_ROWS, MOST_STEPS


class TDConfig(AlgorithmConfig):
    """Off-policy, maximum-entropy actor-critic learning from a replay memory."""

    place: ClassVar[str] = "td"

    polyak: float = Field(
        0.02, gt=0.0, le=1.0, description="step of the target networks towards the trained ones"
    )
    reward_scale: float = Field(
        10.0, gt=0.0, description="1/temperature; a higher value rewards randomness less"
    )
    learning_rate: float = Field(0.002, gt=0.0, le=1.0, description="step size of Adam")
    final_learning_rate_share: float = Field(
        0.05,
        ge=0.0,
        le=1.0,
        description="share of the step size left at the end of training; it falls linearly",
    )
    batch_size: int = Field(256, ge=1, le=MOST_ROWS, description="transitions per update")
    update_every_env_steps: int = Field(
        50,
        ge=1,
        le=MOST_STEPS,
        description="steps of all worlds per update [env-steps]",
    )
    warmup_env_steps: int = Field(
        1_000,
        ge=0,
        le=MOST_STEPS,
        description="steps collected before the first update [env-steps]",
    )
    replay_capacity: int = Field(
        200_000, ge=1, le=MOST_ROWS, description="size of the replay memory"
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
    policy_gradient: Literal["expected", "sampled"] = Field(
        "expected", description="expectation over the robot's own actions, or one sampled action"
    )
    entropy_target: Literal["consistent", "maac"] = Field(
        "consistent",
        description="entropy term of the target: discounted and masked like the value, or as in "
        "the code of MAAC",
    )
    reward_std_floor: float = Field(
        1e-2, gt=0.0, description="least standard deviation that rewards are divided by"
    )

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.replay_capacity < self.batch_size:
            raise ValueError(
                f"td.replay_capacity = {self.replay_capacity}: must be at least "
                f"td.batch_size = {self.batch_size}"
            )
        return self

    @property
    def batches(self) -> Mapping[str, int]:
        """A minibatch is drawn by all workers together."""
        return {"batch_size": self.batch_size}

    @property
    def rows_per_update(self) -> int:
        """Transitions of a batch."""
        return self.batch_size

    def rows_of_training(self, env_steps: int) -> int:
        """Transitions of all batches."""
        return env_steps // self.update_every_env_steps * self.batch_size


TD = Algorithm(
    config=TDConfig, learner="innerattn.learn.td:TD", attends=True, averages_over_workers=True
)
